"""Promises of commands from ROS 2: its bytes become calls; what is no command is reported."""

import math
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from ros_support import FleetDouble, ros2_bridge, ros_commands
from rosbags.typesys import Stores, get_typestore
from support.bus import FLEET, router
from support.scripted import fleet_file_text
from support.waiting import wait_for

from rcopterx.bus.endpoints import client_config
from rcopterx.bus.session import BusAddress
from rcopterx.deploy.hosts.running import RunningFleet

ROS = get_typestore(Stores.ROS2_JAZZY)


def goal(x: float, y: float, z: float, yaw_rad: float, frame: str = "world") -> bytes:
    """The bytes of a `geometry_msgs/PoseStamped`, as ROS 2 sends them."""
    types = ROS.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), frame)
    turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))
    pose = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](x, y, z), turn)
    message = types["geometry_msgs/msg/PoseStamped"](header, pose)
    return bytes(ROS.serialize_cdr(message, "geometry_msgs/msg/PoseStamped"))


EMPTY = bytes(ROS.serialize_cdr(ROS.types["std_msgs/msg/Empty"](), "std_msgs/msg/Empty"))


@given(*3 * [st.floats(-10, 10)], st.floats(-3.1, 3.1))
def test_a_goal_is_read_as_it_was_sent(x: float, y: float, z: float, yaw_rad: float) -> None:
    position_m, heading_rad = ros_commands.goal_of(goal(x, y, z, yaw_rad))
    assert position_m == (x, y, z)
    assert heading_rad == pytest.approx(yaw_rad, abs=1e-9)


@given(st.binary(max_size=200))
def test_other_bytes_are_no_goal_and_raise_one_kind_of_error(payload: bytes) -> None:
    try:
        position_m, _ = ros_commands.goal_of(payload)
    except ros_commands.CommandError:
        return
    assert np.isfinite(position_m).all()


def test_goals_in_other_frames_are_refused() -> None:
    with pytest.raises(ros_commands.CommandError, match="frame 'map'"):
        ros_commands.goal_of(goal(0.0, 0.0, 1.0, 0.0, frame="map"))


@pytest.fixture
def ros_router() -> Iterator[BusAddress]:
    with router() as address:
        yield address


@pytest.fixture
def commanded(bus_address: BusAddress, ros_router: BusAddress) -> Iterator[Any]:
    """A fleet that ROS 2 commands: the double, the reports, and a function that publishes as ROS 2 does."""
    (fleet_endpoint,), (ros_endpoint,) = bus_address.endpoints, ros_router.endpoints
    bridge = ros2_bridge.Bridge(
        FLEET, fleet_endpoint, ros_endpoint, domain=42, namespace=bus_address.namespace,
        ros_namespace=ros_router.namespace,
    )  # fmt: skip
    fleet, reports = FleetDouble(), list[str]()
    bridge.obey(fleet, reports.append)
    with zenoh.open(client_config(list(ros_router.endpoints), ros_router.namespace, 5.0)) as ros:

        def publish(topic: str, payload: bytes = EMPTY) -> None:
            ros.put(f"42/{FLEET}/{topic}/package::msg::dds_::Kind_/RIHS01_0", payload)

        yield fleet, reports, publish
    bridge.close()


def test_commands_reach_the_named_vehicle_or_all(commanded: Any) -> None:
    fleet, reports, publish = commanded
    wait_for(lambda: publish("h3/land") or reports, "no command arrives")
    assert reports[0] == "land: there is no vehicle 'h3'"

    def call_of(topic: str, payload: bytes = EMPTY) -> Any:
        before = len(fleet.calls)
        publish(topic, payload)
        wait_for(lambda: len(fleet.calls) > before, f"no call for {topic}")
        return fleet.calls[-1]

    assert call_of("all/takeoff") == ("take_off", None)
    assert call_of("h2/takeoff") == ("take_off", ["h2"])
    *call, yaw_rad = call_of("h1/goal_pose", goal(0.1, -0.2, 1.1, 0.5))
    assert (call, yaw_rad) == (["go_to", "h1", (0.1, -0.2, 1.1)], pytest.approx(0.5))
    assert call_of("all/emergency") == ("kill", ())
    assert call_of("h1/land") == ("land", ["h1"])
    wait_for(lambda: "refused: h1: stands on the floor" in reports, "the refusal is missing")


def test_an_emergency_does_not_wait_and_too_many_commands_are_reported(commanded: Any) -> None:
    fleet, reports, publish = commanded
    fleet.blocked.clear()
    wait_for(lambda: publish("h1/takeoff") or reports, "the queue does not end")
    assert reports[0] == "takeoff: 10 commands wait already"
    publish("h1/emergency")
    wait_for(lambda: fleet.calls == [("kill", ("h1",))], "no emergency")
    fleet.blocked.set()


def test_the_command_lets_ros_command_the_fleet_that_is_up(
    bus_address: BusAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    snapshot, obeyed = tmp_path / "lab.toml", []
    snapshot.write_text(fleet_file_text(bus_address))
    up = RunningFleet(FLEET, "", None, "main", ["tcp/here"], [], ["h1", "h2"], str(snapshot))

    def interrupt(_seconds: float) -> None:
        raise KeyboardInterrupt

    bridge = SimpleNamespace(obey=lambda fleet: obeyed.append(list(fleet.file.vehicles)), close=lambda: None)
    monkeypatch.setattr(ros2_bridge, "running_fleets", lambda: [up])
    monkeypatch.setattr(ros2_bridge, "Bridge", lambda *_options: bridge)
    monkeypatch.setattr(ros2_bridge, "time", SimpleNamespace(sleep=interrupt))
    monkeypatch.setattr(sys, "argv", ["ros2_bridge.py", "--fleet", FLEET, "--ros", "tcp/there", "--commands"])
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    ros2_bridge.main()
    assert obeyed == [["h1", "h2"]]
