"""Promises of the battery's voltage: no take-off with a weak battery, and a landing before it is empty."""

import math
import struct

import msgspec
import pytest
from firmware_bench import FirmwareBench
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from rcopterx.bus.messages import Battery
from rcopterx.radios.battery import BatteryLimits, BatteryLimitsError
from rcopterx.radios.crazyflie import CrazyflieProtocol, CrazyflieSettings
from rcopterx.radios.crazyflie_battery import DATA_CHANNEL, LOG
from rcopterx.radios.crtp import Packet
from rcopterx.simulator.crazyflie import Crazyflie
from rcopterx.transmitter_gateway.battery import PATIENCE_S, BatteryWatch
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest, State

LIMITS = BatteryLimits(warn_v=3.2, land_v=3.0, full_v=4.2)


class OddCrazyflie(Crazyflie):
    """A firmware whose measurement of the voltage breaks: `odd` replaces its reports."""

    odd: list[float] | None = None

    def receive(self, raw: bytes, now_s: float) -> list[bytes]:
        packets = map(Packet.from_bytes, super().receive(raw, now_s))
        return [changed.to_bytes() for packet in packets for changed in self._changed(packet)]

    def _changed(self, packet: Packet) -> list[Packet]:
        if self.odd is None or (packet.port, packet.channel) != (LOG, DATA_CHANNEL):
            return [packet]
        return [replace(packet, data=packet.data[:4] + struct.pack("<f", value)) for value in self.odd]


class Bench(FirmwareBench):
    """A Crazyflie with a battery."""

    def __init__(self, limits: BatteryLimits = LIMITS) -> None:
        self.vehicle = OddCrazyflie(CrazyflieSettings())
        super().__init__(self.vehicle, CrazyflieProtocol(CrazyflieSettings()), battery=limits)

    @property
    def motors_run(self) -> bool:
        return self.vehicle.motors_run

    def discharge(self, voltage_v: float) -> None:
        """Use so much of the battery that it has this voltage."""
        self.vehicle.voltage_v = voltage_v

    def arm(self) -> str:
        self.run(3.0, 0.0)
        answer = self.transmitter.request(ActionRequest(Action.ARM, "operator"), self.now_s)
        return "" if answer.accepted else answer.reason


def test_a_vehicle_with_a_weak_battery_is_not_armed_and_the_reason_is_the_voltage() -> None:
    bench = Bench()
    bench.discharge(3.1)
    assert "battery at 3.10 V, take-off needs 3.2 V: charge it" in bench.arm()
    assert bench.module == "battery at 3.10 V, take-off needs 3.2 V: charge it"
    bench.vehicle.power_cycle(bench.now_s)
    bench.run(6.0, 0.0)
    assert bench.arm() == ""


def test_a_vehicle_lands_some_seconds_after_its_battery_is_empty_and_before_it_falls() -> None:
    bench = Bench()
    assert bench.arm() == ""
    bench.run(2.0)
    bench.discharge(3.1)
    bench.run(PATIENCE_S + 3.0)
    assert bench.state is State.ARMED
    bench.discharge(2.99)
    bench.run(PATIENCE_S - 1.0)
    assert bench.state is State.ARMED
    bench.run(3.0)
    assert bench.state is State.LAND
    assert "battery" in bench.transmitter.arbiter.reason
    bench.run(5.0)
    assert bench.state is State.CUT, "fresh commands do not end the landing"
    assert "battery empty" in bench.arm()


def test_without_limits_the_voltage_is_only_shown() -> None:
    bench = Bench(BatteryLimits())
    bench.discharge(2.7)
    assert bench.arm() == ""
    bench.run(PATIENCE_S + 3.0)
    assert bench.state is State.ARMED


def test_a_dip_of_the_voltage_ends_no_flight() -> None:
    watch = BatteryWatch(LIMITS)
    for now_s, voltage_v in ((0.0, 3.3), (1.0, 2.8), (5.0, 2.8), (5.5, 3.1), (6.0, 2.8), (10.0, 2.8)):
        watch.observe(voltage_v, now_s, there=True, flying=True)
        assert watch.problem(flying=True) is None


def test_telemetry_that_stops_ends_no_flight_and_permits_no_take_off_that_was_forbidden() -> None:
    watch = BatteryWatch(LIMITS)
    watch.observe(2.9, 0.0, there=True, flying=True)
    watch.observe(None, 3.0, there=True, flying=True)
    watch.observe(None, 60.0, there=True, flying=True)
    assert watch.problem(flying=True) is None
    assert "2.90 V" in (watch.problem(flying=False) or "")
    watch.observe(2.9, 61.0, there=True, flying=True)
    assert "empty" in (watch.problem(flying=True) or ""), "a radio that reports rarely"


@pytest.mark.parametrize("odd", [[], [0.0], [-3.0], [0.3], [1e30], [math.nan]], ids=str)
def test_voltages_that_stop_or_that_no_battery_has_end_no_flight_and_are_not_shown(odd: list[float]) -> None:
    bench = Bench()
    assert bench.arm() == ""
    bench.run(2.0)
    assert " V, link" in bench.module
    bench.vehicle.odd = odd
    bench.run(2.0 * PATIENCE_S)
    assert bench.state is State.ARMED
    assert " V, link" not in bench.module
    assert bench.transmitter.battery.status is None


def test_an_empty_battery_stays_empty_when_its_voltage_recovers_on_the_floor() -> None:
    watch = BatteryWatch(LIMITS)
    for now_s in (0.0, PATIENCE_S):
        watch.observe(2.9, now_s, there=True, flying=True)
    assert "empty" in (watch.problem(flying=True) or "")
    watch.observe(3.6, 20.0, there=True, flying=False)
    assert "empty" in (watch.problem(flying=False) or "")
    watch.observe(None, 30.0, there=False, flying=False)
    watch.observe(4.1, 40.0, there=True, flying=False)
    assert watch.problem(flying=False) is None


def test_an_empty_battery_that_is_charged_on_the_floor_may_fly_again() -> None:
    watch = BatteryWatch(LIMITS)
    for now_s in (0.0, PATIENCE_S):
        watch.observe(2.9, now_s, there=True, flying=True)
    for voltage_v, charged in ((3.9, False), (4.17, True)):
        watch.observe(voltage_v, 60.0, there=True, flying=False)
        assert watch.status is not None
        assert watch.status.charged is charged
        assert (watch.problem(flying=False) is None) is charged


def test_the_status_has_the_flight_time_that_is_left_in_flight_only() -> None:
    watch = BatteryWatch(BatteryLimits(3.2, 3.0, 4.2, hover_s=400.0), hover_thrust=0.5)
    watch.observe(4.2, 0.0, there=True, flying=False)
    assert watch.status is not None
    assert watch.status.left_s is None
    for now_s in (0.0, 100.0):
        watch.observe(3.8, now_s, there=True, flying=True, u=(0.0, 0.0, 0.5, 0.0))
    assert watch.status.left_s == (pytest.approx(0.9 * 0.95 * 400.0 - 100.0), pytest.approx(340.0))


@given(st.lists(st.floats(2.0, 4.5), max_size=40), st.floats(0.1, 2.0))
def test_a_flight_ends_only_if_every_voltage_of_the_last_seconds_was_too_low(
    voltages: list[float], period_s: float
) -> None:
    watch = BatteryWatch(LIMITS)
    low_s = None
    for count, voltage_v in enumerate(voltages):
        now_s = count * period_s
        watch.observe(voltage_v, now_s, there=True, flying=True)
        low_s = (now_s if low_s is None else low_s) if voltage_v < 3.0 else None
        if watch.problem(flying=True) is not None:
            assert low_s is not None
            assert now_s - low_s >= PATIENCE_S
            return
        assert low_s is None or now_s - low_s < PATIENCE_S


def test_the_status_has_voltage_share_and_warning() -> None:
    watch = BatteryWatch(LIMITS)
    assert watch.status is None
    watch.observe(3.6, 0.0, there=True, flying=True)
    assert watch.status is not None
    assert (watch.status.voltage_v, watch.status.share, watch.status.low) == (3.6, pytest.approx(0.5), False)
    watch.observe(3.1, 1.0, there=True, flying=True)
    assert watch.status.low


@pytest.mark.parametrize(
    "limits", [(3.0, 3.2, 4.2), (4.3, 3.0, 4.2), (-1.0, None, None), (float("nan"), None, None)]
)
def test_limits_that_contradict_each_other_are_refused(limits: tuple[float, float, float]) -> None:
    with pytest.raises(BatteryLimitsError):
        BatteryLimits(*limits)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_whatever_voltage_a_firmware_reports_the_status_is_accepted(voltage_v: float) -> None:
    watch = BatteryWatch(LIMITS)
    watch.observe(voltage_v, 0.0, there=True, flying=False)
    assert msgspec.convert(msgspec.to_builtins(watch.status), Battery) == watch.status
