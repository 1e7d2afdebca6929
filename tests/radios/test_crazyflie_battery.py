"""Promises of the battery voltage of a Crazyflie, read from its log."""

import math
import struct
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.radios import crtp
from rcopterx.radios.crazyflie import CrazyflieSettings
from rcopterx.radios.crazyflie_battery import PATIENCE_FRAMES, BatteryLog
from rcopterx.radios.protocol import FrameDecodeError
from rcopterx.radios.set_points import AttitudeSetPoint
from rcopterx.simulator.crazyflie import Crazyflie

FLY = AttitudeSetPoint(thrust=0.6)


class Bench:
    def __init__(self) -> None:
        self.vehicle = Crazyflie(CrazyflieSettings())
        self.log = BatteryLog()
        self.now_s = 0.0
        self.requests = 0

    def run(self, frames: int, point: AttitudeSetPoint, *, every: int = 1) -> None:
        """Exchange frames; of the answers only each `every`th arrives."""
        for frame in range(frames):
            self.now_s += 0.02
            answers = self.vehicle.receive(crtp.set_point_packet(point).to_bytes(), self.now_s)
            wanted = self.log.request()
            if wanted is not None:
                self.requests += 1
                answers += self.vehicle.receive(wanted.to_bytes(), self.now_s)
            for answer in answers if frame % every == 0 else ():
                self.log.take(crtp.Packet.from_bytes(answer))


def test_the_voltage_is_found_and_then_arrives_by_itself() -> None:
    bench = Bench()
    bench.run(60, AttitudeSetPoint())
    assert bench.log.voltage_v is not None
    assert 4.19 < bench.log.voltage_v < 4.21
    asked = bench.requests
    bench.vehicle.voltage_v = 3.7
    bench.run(50 * 60, FLY)
    assert bench.log.voltage_v == pytest.approx(3.7)
    assert bench.requests == asked


def test_answers_that_are_lost_are_asked_for_again() -> None:
    bench = Bench()
    bench.run(300, AttitudeSetPoint(), every=3)
    assert bench.log.voltage_v is not None


def test_a_vehicle_that_started_anew_is_subscribed_to_again() -> None:
    bench = Bench()
    bench.run(100, AttitudeSetPoint())
    bench.vehicle.voltage_v = 3.7
    bench.run(50 * 120, FLY)
    bench.vehicle.power_cycle(bench.now_s)
    worn_v = bench.log.voltage_v
    bench.run(PATIENCE_FRAMES + 100, AttitudeSetPoint())
    assert worn_v is not None
    assert bench.log.voltage_v is not None
    assert bench.log.voltage_v > worn_v


@given(st.lists(st.tuples(st.integers(0, 3), st.binary(max_size=30)), max_size=20))
def test_any_packet_of_the_log_is_taken_or_rejected(packets: list[tuple[int, bytes]]) -> None:
    log = BatteryLog()
    for channel, data in packets:
        with suppress(FrameDecodeError):
            log.take(crtp.Packet(5, channel, data))
        log.request()


def test_a_voltage_that_is_no_number_is_rejected() -> None:
    log = BatteryLog()
    with pytest.raises(FrameDecodeError):
        log.take(crtp.Packet(5, 2, b"\x52\0\0\0" + struct.pack("<f", math.nan)))
    assert log.voltage_v is None
