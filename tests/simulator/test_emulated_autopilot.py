"""Promises of the emulated autopilot: when it arms and changes its mode, and what it reports and rejects."""

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.dialects.v20 import common as mavlink

from rcopterx.radios.mavlink import FORCE
from rcopterx.radios.mavlink_settings import MODES, MavlinkSettings
from rcopterx.simulator.autopilot import (
    DENIED,
    ENDURANCE_S,
    LAND,
    LOITER,
    LOSS_S,
    NORTH_RAD,
    SLOWEST_STREAM_S,
    STREAM_BEFORE_S,
    EmulatedAutopilot,
)
from rcopterx.simulator.plant import BodyPose

OFFBOARD = MODES["offboard"].reported
ARM, MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
ACCEPTED, REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
STICKS = (1.0, 0.0, 0.0, 0.0)
"""A level attitude at heading 0."""


class Station:
    """A ground station of the vehicle, in virtual time."""

    def __init__(self) -> None:
        self.vehicle = EmulatedAutopilot(MavlinkSettings())
        self.link = mavlink.MAVLink(None, 255, 190)
        self.reader = mavlink.MAVLink(None)
        self.now_s = 0.0
        self.place()

    def place(self, height_m: float = 0.0, **angles_rad: float) -> None:
        body: Any = SimpleNamespace(pose=BodyPose((0.0, 0.0, height_m), **angles_rad))
        self.vehicle.sense(body)

    def send(self, message: Any) -> list[Any]:
        raw = b"".join(self.vehicle.receive(message.pack(self.link), self.now_s))
        return self.reader.parse_buffer(raw) or []

    def command(self, command: int, *words: float, system: int = 1) -> tuple[int, str]:
        """Result of a command, and the text that came with it."""
        values = [*words, *([0.0] * (7 - len(words)))]
        answers = self.send(self.link.command_long_encode(system, 1, command, 0, *values))
        texts = [answer.text for answer in answers if answer.get_type() == "STATUSTEXT"]
        return answers[-1].result, "".join(texts)

    def stream(self, seconds: float, thrust: float = 0.0, interval_s: float = 0.02) -> None:
        for _ in range(round(seconds / interval_s)):
            self.now_s += interval_s
            self.send(self.link.set_attitude_target_encode(0, 1, 1, 3, list(STICKS), 0.0, 0.0, 0.0, thrust))

    def offboard(self) -> "Station":
        self.stream(STREAM_BEFORE_S + 0.1)
        assert self.command(MODE, 1, 6) == (ACCEPTED, "")
        return self

    def reports(self, seconds: float) -> list[Any]:
        found = []
        for _ in range(round(seconds / 0.02)):
            self.now_s += 0.02
            self.vehicle.advance(self.now_s)
            found += self.reader.parse_buffer(b"".join(self.vehicle.reports(self.now_s))) or []
        return found


def test_offboard_needs_a_stream_of_set_points_that_is_fast_and_long_enough() -> None:
    station = Station()
    assert station.command(MODE, 1, 6)[0] == REJECTED
    station.stream(STREAM_BEFORE_S - 0.1)
    assert station.command(MODE, 1, 6)[0] == REJECTED
    station.stream(5.0, interval_s=SLOWEST_STREAM_S + 0.1)
    assert station.command(MODE, 1, 6)[0] == REJECTED
    station.offboard()
    assert station.vehicle.mode == OFFBOARD


def test_other_modes_than_hold_and_land_are_not_there() -> None:
    station = Station()
    assert station.command(MODE, 1, 4, 6) == (ACCEPTED, "")
    assert station.vehicle.mode == LAND
    assert station.command(MODE, 1, 3) == (REJECTED, "This mode is currently not available")


def test_it_arms_without_thrust_with_a_stream_and_with_a_battery() -> None:
    station = Station().offboard()
    station.stream(0.1, thrust=0.3)
    assert station.command(ARM, 1) == (REJECTED, "Arming denied: thrust is not zero")
    station.now_s += SLOWEST_STREAM_S + 0.1
    assert station.command(ARM, 1) == (REJECTED, "Arming denied: no offboard signal")
    station.stream(STREAM_BEFORE_S + 0.1)
    assert station.command(ARM, 1) == (ACCEPTED, "")
    station.stream(ENDURANCE_S + 1.0, interval_s=0.4)
    assert station.command(ARM, 0) == (ACCEPTED, "")
    assert station.command(ARM, 1) == (REJECTED, DENIED)
    station.vehicle.power_cycle(station.now_s)
    assert station.command(ARM, 1)[1].startswith("Arming denied: Resolve system health failures first")
    station.offboard()
    assert station.command(ARM, 1) == (ACCEPTED, "")


def test_in_the_air_it_is_disarmed_by_force_only() -> None:
    station = Station().offboard()
    station.command(ARM, 1)
    station.place(0.5)
    assert station.command(ARM, 0) == (REJECTED, "Disarming denied: not landed")
    assert station.command(ARM, 0, FORCE) == (ACCEPTED, "")
    assert not station.vehicle.armed


def test_a_terminated_flight_ends_with_a_restart() -> None:
    station = Station().offboard()
    station.command(ARM, 1)
    assert station.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1) == (ACCEPTED, "")
    assert not station.vehicle.armed
    assert "restart it" in station.command(ARM, 1)[1]
    station.vehicle.power_cycle(station.now_s)
    station.offboard()
    assert station.command(ARM, 1) == (ACCEPTED, "")


def test_without_set_points_it_lands_and_disarms_on_the_floor() -> None:
    station = Station().offboard()
    station.command(ARM, 1)
    station.place(0.5)
    station.stream(10.0, thrust=0.6)
    hover_us = station.vehicle.take_outputs()[-1][1][0]
    station.reports(LOSS_S + 0.1)
    assert station.vehicle.mode == LAND
    landing_us = station.vehicle.take_outputs()[-1][1][0]
    assert 1100.0 < landing_us < hover_us
    station.place(0.0)
    station.reports(0.1)
    assert not station.vehicle.armed
    assert station.vehicle.take_outputs()[-1][1][0] == 1100.0


def test_reports_have_attitude_mode_and_a_battery_that_empties() -> None:
    station = Station().offboard()
    station.place(0.0, yaw_rad=0.25, pitch_rad=0.1, roll_rad=-0.2)
    station.command(ARM, 1)
    reports = station.reports(0.9)
    by_kind = {report.get_type(): report for report in reports}
    assert set(by_kind) == {"HEARTBEAT", "ATTITUDE", "SYS_STATUS"}
    attitude = by_kind["ATTITUDE"]
    angles = (attitude.roll, attitude.pitch, attitude.yaw)
    assert angles == pytest.approx((-0.2, -0.1, NORTH_RAD - 0.25))
    assert by_kind["HEARTBEAT"].custom_mode == OFFBOARD
    assert by_kind["HEARTBEAT"].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    station.place(0.5)
    last = [each for each in station.reports(60.0) if each.get_type() == "SYS_STATUS"][-1]
    assert (last.voltage_battery, last.battery_remaining) == (pytest.approx(16_520, abs=20), 90)
    station.vehicle.switch_off()
    assert station.reports(2.0) == []
    assert station.send(station.link.heartbeat_encode(6, 8, 0, 0, 4)) == []


def test_a_report_comes_as_often_as_requested() -> None:
    station = Station()
    interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    assert station.command(interval, mavlink.MAVLINK_MSG_ID_ATTITUDE, 20_000) == (ACCEPTED, "")
    assert station.command(interval, 999, 20_000) == (mavlink.MAV_RESULT_UNSUPPORTED, "")
    attitudes = [report for report in station.reports(2.0) if report.get_type() == "ATTITUDE"]
    assert 95 <= len(attitudes) <= 101


def test_what_is_for_others_or_malformed_is_rejected() -> None:
    station = Station()
    station.vehicle.receive(bytes(20), 0.0)
    point = station.link.set_attitude_target_encode(0, 9, 1, 3, list(STICKS), 0.0, 0.0, 0.0, 0.5)
    assert station.send(point) == []
    broken = station.link.set_attitude_target_encode(0, 1, 1, 3, [math.nan] * 4, 0.0, 0.0, 0.0, 0.5)
    assert station.send(broken) == []
    assert station.vehicle.rejected == {
        "mavlink: malformed": 1,
        "mavlink: for another system": 1,
        "mavlink: a set point that is not finite": 1,
    }
    assert not station.vehicle.frames


@given(st.lists(st.binary(max_size=60), max_size=20))
def test_any_bytes_are_survived(raw: list[bytes]) -> None:
    station = Station()
    for data in raw:
        station.vehicle.receive(data, 0.0)
    assert (station.vehicle.armed, station.vehicle.mode) == (False, LOITER)


@pytest.mark.parametrize("words", [(math.nan, 6.0), (math.inf, 6.0), (1.0, math.nan), (1.0, -math.inf)])
def test_a_mode_that_is_not_finite_is_rejected(words: tuple[float, float]) -> None:
    station = Station()
    assert station.send(station.link.command_long_encode(1, 1, MODE, 0, 1.0, *words, 0, 0, 0, 0)) == []
    assert station.vehicle.rejected == {"mavlink: a mode that is not finite": 1}


@pytest.mark.parametrize(("mode", "shown"), [("guided_nogps", (9, 8, 7)), ("offboard", None)])
def test_ardupilot_shows_a_colour_if_its_parameter_lets_it_and_px4_none(
    mode: str, shown: tuple[int, int, int] | None
) -> None:
    vehicle = EmulatedAutopilot(MavlinkSettings(mode=mode))
    colour = ardupilotmega.MAVLink_led_control_message(1, 1, 255, 255, 3, [9, 8, 7, *21 * [0]])
    raw = colour.pack(ardupilotmega.MAVLink(None, 255, 190))
    vehicle.receive(raw, 0.1)
    assert vehicle.light == shown
    if shown:
        vehicle.light, vehicle.parameters["NTF_LED_OVERRIDE"] = None, 0.0
        vehicle.receive(raw, 0.2)
        assert vehicle.light is None
