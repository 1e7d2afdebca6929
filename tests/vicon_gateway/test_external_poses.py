"""Promises of poses for autopilots: in their axes, at most 50 a second, none of hidden vehicles."""

import socket
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mavlink

from rcopterx.deploy.roles.tracker import tracker_settings
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.simulator.plant import BodyPose
from rcopterx.vicon_gateway.external_poses import PoseLink, PoseSender
from rcopterx.vicon_gateway.frame import SubjectPose

ANGLES = st.floats(-1.4, 1.4)
FLEET = """
name = "poses"
[vehicles.h1]
type = "mavlink_quadrotor"
subject = "quad1"
transmitter = {{ port = "udp://127.0.0.1:14550", settings = {{ {} }} }}
"""


def subject(pose: BodyPose) -> SubjectPose:
    return SubjectPose("quad1", False, pose.position_m, pose.quaternion_xyzw, None)


class Autopilot:
    """A second link of an autopilot."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self.link = PoseLink(self._socket.getsockname(), 3)

    def received(self) -> list[Any]:
        reader, found = mavlink.MAVLink(None), []
        while True:
            try:
                found += reader.parse_buffer(self._socket.recv(2048)) or []
            except BlockingIOError:
                return found

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def autopilot() -> Iterator[Autopilot]:
    opened = Autopilot()
    yield opened
    opened.close()


@given(st.tuples(ANGLES, ANGLES, st.floats(-3.1, 3.1)))
def test_a_pose_arrives_in_the_axes_of_the_autopilot(angles_rad: tuple[float, float, float]) -> None:
    roll, nose_down, yaw = angles_rad
    autopilot = Autopilot()
    sender = PoseSender({"h1": autopilot.link})
    sender.send("h1", subject(BodyPose((1.0, 2.0, 3.0), yaw, nose_down, roll)), 0.5)
    [message] = autopilot.received()
    sender.close()
    autopilot.close()
    assert (message.usec, message.x, message.y, message.z) == (500_000, 1.0, -2.0, -3.0)
    assert (message.roll, message.pitch, message.yaw) == pytest.approx((roll, -nose_down, -yaw), abs=1e-5)
    assert (message.get_srcSystem(), message.get_srcComponent()) == (3, 197)


def test_poses_are_sent_at_50_hz_and_not_for_others_or_while_the_vehicle_is_hidden(
    autopilot: Autopilot,
) -> None:
    sender, seen = PoseSender({"h1": autopilot.link}), subject(BodyPose((0.0, 0.0, 1.0)))
    for frame in range(200):
        sender.send("h1", seen, 0.005 * frame)
        sender.send("h2", seen, 0.005 * frame)
    sender.send("h1", SubjectPose("quad1", True, None, None, None), 2.0)
    messages = autopilot.received()
    sender.close()
    assert len(messages) == 50
    assert [message.get_seq() for message in messages] == list(range(50))


def test_an_address_that_cannot_be_reached_is_counted_and_ends_nothing() -> None:
    sender = PoseSender({"h1": PoseLink(("255.255.255.255", 9), 1)})
    sender.send("h1", subject(BodyPose((0.0, 0.0, 1.0))), 0.0)
    sender.close()
    assert sender.failed == 1


def test_a_fleet_file_names_the_links_of_the_vehicles_that_want_poses() -> None:
    with_link = parse_fleet(FLEET.format('pose_port = "udp://127.0.0.1:14560", system = 2'))
    assert tracker_settings(with_link).pose_links == {"h1": PoseLink(("127.0.0.1", 14560), 2)}
    assert tracker_settings(parse_fleet(FLEET.format("system = 2"))).pose_links == {}


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ('pose_port = "quad1:14560"', "no address such as"),
        ('pose_port = "udp://quad1:14560"', "'quad1' is no IP address"),
        ('pose_port = "udp://127.0.0.1:14560", external_pose = true', "leave external_pose out"),
    ],
)
def test_a_link_for_poses_that_cannot_be_used_is_refused(settings: str, reason: str) -> None:
    with pytest.raises(FleetError, match=reason):
        tracker_settings(parse_fleet(FLEET.format(settings)))
