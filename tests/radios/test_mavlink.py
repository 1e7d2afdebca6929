"""Promises of the MAVLink driver: set points, directions, headings and poses."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mavlink_peer import ARMED, HOVER, IDLE, LOW, Peer, pulses
from pymavlink.dialects.v20 import common as mavlink

from rcopterx.radios.mavlink import LARGEST_LEAD_RAD, MavlinkProtocol, set_point_of
from rcopterx.radios.mavlink_settings import MavlinkSettings
from rcopterx.radios.mavlink_state import SILENT_S
from rcopterx.radios.protocol import FrameDecodeError, ProtocolError


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


def test_poses_are_sent_once_each_in_the_axes_of_the_autopilot() -> None:
    peer, silent = Peer(external_pose=True), Peer()
    peer.report(peer.link.attitude_encode(0, 0.1, -0.2, 0.3, 0.0, 0.0, 0.0))
    for one in (peer, silent):
        one.protocol.pose_seen((1.0, 2.0, 3.0), 0.5, standing=False)
    [pose] = [each for each in peer.frame(LOW) if each.get_type() == "VISION_POSITION_ESTIMATE"]
    assert (pose.x, pose.y, pose.z) == (1.0, -2.0, -3.0)
    assert (pose.roll, pose.pitch, pose.yaw) == pytest.approx((0.1, -0.2, -0.5))
    assert math.isnan(pose.covariance[0])
    for one in (peer, silent):
        assert "VISION_POSITION_ESTIMATE" not in [each.get_type() for each in one.frame(LOW)]


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
