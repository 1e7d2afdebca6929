"""Promises of the MAVLink driver: directions, modes, arming, stop and readiness; pymavlink is the peer."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.dialects.v20 import common as mavlink
from pymavlink.quaternion import QuaternionBase

from rcopterx.transmitter_gateway.protocols.base import FrameDecodeError, FrameFlags, ProtocolError
from rcopterx.transmitter_gateway.protocols.mavlink import (
    FORCE,
    LARGEST_LEAD_RAD,
    MavlinkProtocol,
    set_point_of,
)
from rcopterx.transmitter_gateway.protocols.mavlink_settings import MavlinkSettings
from rcopterx.transmitter_gateway.protocols.mavlink_state import (
    HEARTBEAT_GONE_S,
    SETTLING_S,
    SILENT_S,
)
from rcopterx.transmitter_gateway.protocols.set_points import SetPoint

DISARMED, ARMED = 1100.0, 1900.0
HOVER = (1500.0, 1500.0, 1500.0, 1500.0, ARMED)
IDLE = (1100.0, 1500.0, 1500.0, 1500.0, ARMED)
LOW = (1100.0, 1500.0, 1500.0, 1500.0, DISARMED)
KILL = FrameFlags(kill=True)
PX4, ARDUPILOT = mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
OFFBOARD, GUIDED, GUIDED_NOGPS = 6, 4, 20
ARM, MODE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_SET_MODE
pulses = st.floats(1100.0, 1900.0)


class Peer:
    """A driver in virtual time, and the autopilot at the other end, whose reports a test writes."""

    def __init__(self, yaw_rad: float = 0.0, dialect: Any = mavlink, **settings: Any) -> None:
        self.protocol = MavlinkProtocol(MavlinkSettings(**settings))
        self.now_s = 0.0
        self.dialect = dialect
        self.link = dialect.MAVLink(None, srcSystem=self.protocol.settings.system, srcComponent=1)
        self.protocol.link_opened(0.0)
        if yaw_rad is not None:
            self.attitude(yaw_rad)

    def report(self, message: Any) -> None:
        self.protocol.receive(message.pack(self.link), self.now_s)
        self.link.seq = (self.link.seq + 1) % 256

    def attitude(self, yaw_rad: float) -> None:
        self.report(self.link.attitude_encode(0, 0.0, 0.0, yaw_rad, 0.0, 0.0, 0.0))

    def heartbeat(self, *, armed: bool = False, mode: int = 0, autopilot: int = PX4) -> None:
        flags = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        self.report(self.link.heartbeat_encode(mavlink.MAV_TYPE_QUADROTOR, autopilot, flags, mode, 0))

    def answer(self, command: int, result: int = mavlink.MAV_RESULT_ACCEPTED) -> None:
        self.report(self.link.command_ack_encode(command, result))

    def frame(self, channels: tuple[float, ...], flags: FrameFlags = FrameFlags()) -> list[Any]:  # noqa: B008
        """Messages of the next frame, 25 ms later."""
        frame = self.protocol.encode(channels, flags)
        self.now_s += 0.025
        self.protocol.frame_written(self.now_s)
        return mavlink.MAVLink(None).parse_buffer(frame) or []

    def commands(self, channels: tuple[float, ...], frames: int = 11) -> list[tuple[int, ...]]:
        """Commands of the frames of 0.25 s with their first words."""
        return [
            (each.command, each.param1, each.param2)
            for _ in range(frames)
            for each in self.frame(channels)
            if each.get_type() == "COMMAND_LONG" and each.command != mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        ]

    def set_point(self, channels: tuple[float, ...]) -> tuple[Any, list[float]]:
        """Set point of the next frame with its roll, pitch and yaw."""
        [point] = [each for each in self.frame(channels) if each.get_type() == "SET_ATTITUDE_TARGET"]
        return point, list(QuaternionBase(point.q).euler)

    @property
    def text(self) -> str:
        return self.protocol.status(self.now_s).text

    @property
    def ready(self) -> bool:
        return self.protocol.status(self.now_s).ready


@given(pulses, pulses, pulses, st.floats(1200.0, 1900.0), st.floats(-3.0, 3.0))
def test_a_frame_of_an_armed_vehicle_is_read_back_at_any_heading(
    aileron: float, elevator: float, rudder: float, throttle: float, yaw_rad: float
) -> None:
    peer = Peer(yaw_rad)
    sent = (throttle, aileron, elevator, rudder, ARMED)
    point, heading_rad = set_point_of(peer.set_point(sent)[0])
    assert math.remainder(heading_rad - yaw_rad, math.tau) == pytest.approx(0.0, abs=1e-5)
    assert peer.protocol.settings.pulses_us(point, armed=True) == pytest.approx(sent, abs=0.01)


@pytest.mark.parametrize(
    ("channel", "roll_deg", "pitch_deg", "yaw_rate_deg_s"),
    [(1, 30.0, 0.0, 0.0), (2, 0.0, -30.0, 0.0), (3, 0.0, 0.0, 200.0)],
)
def test_sticks_to_the_right_and_forward_are_right_side_down_nose_down_and_clockwise(
    channel: int, roll_deg: float, pitch_deg: float, yaw_rate_deg_s: float
) -> None:
    sticks = [*HOVER]
    sticks[channel] = 1900.0
    point, angles = Peer(1.0).set_point(tuple(sticks))
    assert angles == pytest.approx([math.radians(roll_deg), math.radians(pitch_deg), 1.0], abs=1e-6)
    assert math.degrees(point.body_yaw_rate) == pytest.approx(yaw_rate_deg_s)
    assert point.thrust == pytest.approx(0.5)
    assert (point.target_system, point.target_component) == (1, 1)


def test_the_heading_moves_with_the_yaw_rate_and_stays_near_that_of_the_vehicle() -> None:
    peer = Peer(3.0)
    turning = (1500.0, 1500.0, 1500.0, 1600.0, ARMED)
    before = peer.set_point(turning)[1][2]
    for _ in range(4):
        peer.frame(turning)
    moved = math.remainder(peer.set_point(turning)[1][2] - before, math.tau)
    assert moved == pytest.approx(0.025 * 5 * math.radians(50.0), rel=0.3)
    for _ in range(400):
        peer.frame(turning)
    lead = math.remainder(peer.set_point(turning)[1][2] - 3.0, math.tau)
    assert lead == pytest.approx(LARGEST_LEAD_RAD, abs=1e-6)


def test_without_thrust_the_heading_is_that_of_the_vehicle() -> None:
    peer = Peer(1.0)
    peer.set_point(IDLE)
    peer.attitude(-2.0)
    assert peer.set_point(IDLE)[1][2] == pytest.approx(-2.0)
    assert peer.set_point(HOVER)[1][2] == pytest.approx(-2.0)


def test_without_a_heading_there_is_no_set_point_but_a_request_and_a_heartbeat() -> None:
    protocol = MavlinkProtocol()
    protocol.link_opened(0.0)
    messages = mavlink.MAVLink(None).parse_buffer(protocol.encode(LOW))
    assert [each.get_type() for each in messages] == ["COMMAND_LONG", "COMMAND_LONG", "HEARTBEAT"]
    assert [each.param1 for each in messages[:2]] == [30, 1]
    assert [each.get_type() for each in mavlink.MAVLink(None).parse_buffer(protocol.encode(LOW))] == [
        "HEARTBEAT"
    ]


def test_heartbeats_of_a_ground_station_and_set_points_come_fast_enough_for_offboard() -> None:
    peer = Peer()
    messages = [each for _ in range(80) for each in peer.frame(LOW)]
    beats = [each for each in messages if each.get_type() == "HEARTBEAT"]
    assert len(beats) >= 3
    assert {(each.get_srcSystem(), each.type) for each in beats} == {(255, mavlink.MAV_TYPE_GCS)}
    points = [each for each in messages if each.get_type() == "SET_ATTITUDE_TARGET"]
    assert len(points) == 80
    assert {point.thrust for point in points} == {0.0}
    assert peer.protocol.keepalive_s < 0.5


@pytest.mark.parametrize(
    ("mode", "autopilot", "number", "reported", "mask"),
    [
        ("offboard", PX4, OFFBOARD, OFFBOARD << 16, 0b011),
        ("guided_nogps", ARDUPILOT, GUIDED_NOGPS, GUIDED_NOGPS, 0),
        ("guided", ARDUPILOT, GUIDED, GUIDED, 0),
    ],
)
def test_mode_then_arming_are_requested_until_they_are_reported(
    mode: str, autopilot: int, number: int, reported: int, mask: int
) -> None:
    peer = Peer(mode=mode)
    peer.heartbeat(autopilot=autopilot)
    assert peer.commands(LOW) == []
    assert peer.commands(IDLE, 31) == [(MODE, 1, number)] * 4
    peer.answer(MODE)
    assert peer.commands(IDLE) == [(ARM, 1, 0)]
    peer.heartbeat(autopilot=autopilot, mode=reported)
    assert peer.commands(IDLE) == [(ARM, 1, 0)]
    peer.answer(ARM)
    peer.attitude(0.0)
    assert peer.commands(HOVER) == []
    assert peer.ready
    assert peer.set_point(HOVER)[0].type_mask == mask


def test_a_late_heartbeat_does_not_undo_an_answer() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(IDLE)
    peer.answer(ARM)
    peer.heartbeat(mode=OFFBOARD << 16, armed=False)
    peer.attitude(0.0)
    peer.frame(HOVER)
    assert peer.ready
    peer.now_s += SETTLING_S
    peer.heartbeat(mode=OFFBOARD << 16, armed=False)
    peer.attitude(0.0)
    assert peer.text == "the autopilot has disarmed"


def test_an_answer_to_someone_else_says_nothing_about_our_commands() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    peer.commands(IDLE)
    peer.report(peer.link.command_ack_encode(ARM, mavlink.MAV_RESULT_ACCEPTED, target_system=7))
    assert (ARM, 1, 0) in peer.commands(IDLE)


def test_with_thrust_no_vehicle_is_armed_and_the_refusal_is_shown() -> None:
    peer = Peer()
    peer.heartbeat(mode=OFFBOARD << 16)
    assert peer.commands(HOVER, 3) == []
    assert peer.text == "the autopilot did not arm: no answer"
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    assert peer.text == "the autopilot did not arm: MAV_RESULT 2"
    peer.report(peer.link.statustext_encode(mavlink.MAV_SEVERITY_INFO, b"home set"))
    peer.report(peer.link.statustext_encode(mavlink.MAV_SEVERITY_CRITICAL, b"Preflight Fail: compass"))
    peer.answer(ARM, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    assert peer.text == "the autopilot did not arm: Preflight Fail: compass"
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    assert peer.text == "the autopilot did not arm: MAV_RESULT 2", "a text belongs to one refusal"
    peer.report(peer.link.statustext_encode(mavlink.MAV_SEVERITY_CRITICAL, b"Preflight Fail: compass"))
    peer.answer(ARM, mavlink.MAV_RESULT_DENIED)
    peer.frame(LOW)
    assert peer.text == "ready, link 100 %; refused: Preflight Fail: compass"


def test_a_vehicle_is_disarmed_until_it_reports_it_but_not_in_a_mode_of_others() -> None:
    peer = Peer()
    peer.heartbeat(armed=True, mode=OFFBOARD << 16)
    assert set(peer.commands(LOW, 31)) == {(ARM, 0, 0)}
    peer.heartbeat(mode=OFFBOARD << 16)
    assert peer.commands(LOW) == []
    peer.heartbeat(armed=True)
    assert peer.commands(LOW) == []
    peer.attitude(0.0)
    assert peer.text == "someone else has armed the vehicle"


def test_a_mode_that_changes_in_flight_is_not_changed_back() -> None:
    peer = Peer()
    peer.heartbeat(armed=True, mode=OFFBOARD << 16)
    peer.frame(HOVER)
    peer.heartbeat(armed=True, mode=4 << 16)
    peer.attitude(0.0)
    assert peer.commands(HOVER) == []
    assert peer.text == "a pilot or a failsafe has changed the mode"


@given(pulses, pulses, st.booleans())
def test_without_the_arming_channel_or_with_a_kill_there_is_no_thrust(
    throttle: float, aileron: float, kill: bool
) -> None:
    peer = Peer()
    peer.heartbeat(armed=True, mode=OFFBOARD << 16)
    channels = (throttle, aileron, 1500.0, 1500.0, ARMED if kill else DISARMED)
    by_kind = {each.get_type(): each for each in peer.frame(channels, FrameFlags(kill=kill))}
    assert set_point_of(by_kind["SET_ATTITUDE_TARGET"])[0] == SetPoint()
    command = by_kind["COMMAND_LONG"]
    assert (command.command, command.param1, command.param2 == FORCE) == (ARM, 0, kill)


def test_a_kill_forces_in_every_frame_until_it_is_reported_and_then_now_and_then() -> None:
    peer = Peer(flight_termination=True)
    for known in (False, True):
        if known:
            peer.heartbeat(armed=True, mode=OFFBOARD << 16)
        for _ in range(5):
            kinds = [(each.command, each.param1, each.param2) for each in peer.frame(HOVER, KILL)[:2]]
            assert kinds == [(ARM, 0, FORCE), (mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1, 0)]
    peer.heartbeat(armed=False)
    forced = [
        each for _ in range(40) for each in peer.frame(LOW, KILL) if getattr(each, "param2", 0) == FORCE
    ]
    assert len(forced) in (3, 4)


@pytest.mark.parametrize(
    ("act", "ready", "words"),
    [
        (lambda peer: None, False, "no heartbeat from the autopilot yet"),
        (lambda peer: peer.heartbeat(), True, "ready, link 100 %"),
        (lambda peer: peer.heartbeat(autopilot=ARDUPILOT), False, "does not have the mode"),
    ],
)
def test_a_vehicle_is_ready_when_its_autopilot_would_fly(
    act: Callable[[Peer], None], ready: bool, words: str
) -> None:
    peer = Peer()
    act(peer)
    assert peer.ready is ready
    assert words in peer.text
    assert MavlinkProtocol().status(0.0).text == "port not open"


def test_silence_is_noticed() -> None:
    peer = Peer()
    peer.heartbeat()
    peer.now_s = SILENT_S + 0.1
    assert peer.text == "no attitude from the autopilot"
    peer.now_s = HEARTBEAT_GONE_S + 0.1
    peer.attitude(0.0)
    assert peer.text == "vehicle gone: no heartbeat for 3.1 s"
    peer.heartbeat()
    assert peer.ready


def test_the_status_has_voltage_and_the_share_of_packets_that_arrived() -> None:
    peer = Peer()
    peer.heartbeat()
    peer.report(peer.link.sys_status_encode(0, 0, 0, 0, 65535, -1, -1, 0, 0, 0, 0, 0, 0))
    assert peer.text == "ready, link 100 %"
    peer.report(peer.link.sys_status_encode(0, 0, 0, 0, 15_430, -1, -1, 0, 0, 0, 0, 0, 0))
    peer.link.seq = (peer.link.seq + 4) % 256
    peer.attitude(0.0)
    peer.attitude(0.0)
    assert peer.text == "ready, 15.43 V, link 56 %"


def test_reports_arrive_in_pieces_as_on_a_serial_line() -> None:
    peer = Peer()
    for message in (
        peer.link.heartbeat_encode(mavlink.MAV_TYPE_QUADROTOR, PX4, 0, 0, 0),
        peer.link.attitude_encode(0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0),
    ):
        for byte in message.pack(peer.link):
            peer.protocol.receive(bytes((byte,)), 0.0)
    assert peer.ready
    assert peer.set_point(IDLE)[1][2] == pytest.approx(1.5)


def test_packets_of_other_dialects_count_and_those_of_others_do_not() -> None:
    peer = Peer(dialect=ardupilotmega)
    peer.heartbeat()
    peer.report(peer.link.meminfo_encode(0, 0))
    peer.attitude(0.0)
    other = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    peer.protocol.receive(other.attitude_encode(0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0).pack(other), 0.0)
    peer.protocol.receive(b"\xfe" + peer.link.meminfo_encode(0, 0).pack(peer.link, True)[1:], 0.0)
    assert peer.text == "ready, link 100 %"
    assert peer.set_point(HOVER)[1][2] == 0.0


def test_a_successor_flies_on_with_the_first_attitude() -> None:
    peer = Peer()
    peer.protocol.link_resumed(5.0)
    peer.now_s = 5.0
    assert peer.ready
    assert "SET_ATTITUDE_TARGET" not in [each.get_type() for each in peer.frame(HOVER)]
    peer.attitude(2.0)
    assert peer.set_point(HOVER)[1][2] == pytest.approx(2.0)
    assert peer.commands(HOVER) == []
    peer.now_s += SILENT_S + 0.1
    assert not peer.ready


PIECES = st.one_of(
    st.binary(max_size=60),
    st.sampled_from([b"\xfd", b"\xfd\xff\x00", b"\xfe\x09", b"\xfd\x09\x01"]),
    st.builds(
        lambda yaw, end: (
            mavlink.MAVLink(None, 1, 1)
            .attitude_encode(0, 0, 0, yaw, 0, 0, 0)
            .pack(mavlink.MAVLink(None, 1, 1))[:end]
        ),
        st.floats(width=32),
        st.integers(1, 60),
    ),
)


@given(st.lists(PIECES, max_size=12))
def test_malformed_bytes_are_counted_and_never_raise(raw: list[bytes]) -> None:
    peer = Peer()
    for data in raw:
        peer.protocol.receive(data, 0.0)
        assert len(peer.text) < 200
    # Longer than the longest packet: whatever had begun has ended.
    peer.protocol.receive(bytes(600), 0.0)
    assert peer.protocol.counters["mavlink: malformed"] > 0


def test_poses_are_sent_once_each_in_the_axes_of_the_autopilot() -> None:
    peer, silent = Peer(external_pose=True), Peer()
    peer.report(peer.link.attitude_encode(0, 0.1, -0.2, 0.3, 0.0, 0.0, 0.0))
    for one in (peer, silent):
        one.protocol.pose_seen((1.0, 2.0, 3.0), 0.5)
    [pose] = [each for each in peer.frame(LOW) if each.get_type() == "VISION_POSITION_ESTIMATE"]
    assert (pose.x, pose.y, pose.z) == (1.0, -2.0, -3.0)
    assert (pose.roll, pose.pitch, pose.yaw) == pytest.approx((0.1, -0.2, -0.5))
    assert math.isnan(pose.covariance[0])
    for one in (peer, silent):
        assert "VISION_POSITION_ESTIMATE" not in [each.get_type() for each in one.frame(LOW)]


def test_an_attitude_that_is_not_finite_is_counted_and_not_used() -> None:
    peer = Peer(1.0)
    peer.attitude(math.nan)
    assert peer.protocol.counters["mavlink: an attitude that is not finite"] == 1
    assert peer.set_point(HOVER)[1][2] == pytest.approx(1.0)


@given(st.lists(st.floats(width=32), min_size=4, max_size=4), st.floats(width=32), st.floats(width=32))
def test_a_set_point_of_any_numbers_is_read_or_refused(q: list[float], rate: float, thrust: float) -> None:
    link = mavlink.MAVLink(None, 255, 190)
    for rotation in (q, [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0004]):
        message = link.set_attitude_target_encode(0, 1, 1, 0, rotation, 0.0, 0.0, rate, thrust)
        finite = all(map(math.isfinite, (*rotation, rate, thrust)))
        if finite and abs(math.hypot(*rotation) - 1.0) < 1e-3:
            assert set_point_of(message)[0].thrust == min(max(thrust, 0.0), 1.0)
        else:
            with pytest.raises(FrameDecodeError, match="no rotation" if finite else "not finite"):
                set_point_of(message)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"full_tilt_deg": 0.0}, "full_tilt_deg"),
        ({"system": 0}, "mavlink.system: 0 is outside 1..255"),
        ({"system": 7, "own_system": 7}, "own_system: 7 is the vehicle's"),
        ({"baud": 9600}, "mavlink.baud: 9600 is outside 57600"),
        ({"mode": "loiter"}, "mavlink.mode: 'loiter' is unknown, choose one of offboard"),
    ],
)
def test_wrong_settings_are_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ProtocolError, match=words):
        MavlinkSettings(**settings)


def test_the_speed_of_a_serial_line_is_a_setting() -> None:
    assert MavlinkProtocol(MavlinkSettings(baud=57_600)).line.baud == 57_600
