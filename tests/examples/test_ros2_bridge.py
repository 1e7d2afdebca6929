"""Promises of the ROS 2 bridge: ROS 2 decodes what it sends, by its own definitions and under its keys."""

import threading
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st
from ros_support import ros2_bridge, ros_messages
from rosbags.typesys import Stores, get_typestore
from support.bus import FLEET, router
from support.messages import wire_maps
from support.waiting import wait_for

from rcopterx.bus import channels
from rcopterx.bus.endpoints import client_config
from rcopterx.bus.messages import Command, Plan, Pose
from rcopterx.bus.session import BusAddress, Session
from rcopterx.bus.trajectory_array import TrajectoryArray

ROS = get_typestore(Stores.ROS2_JAZZY)
KINDS = (ros_messages.PoseStamped, ros_messages.Path, ros_messages.Joy)
NOW_S = 1_700_000_000.25
POSE = Pose(
    epoch=1, frame=7, period_s=0.02, latency_s=0.25, received_s=0.0, occluded=False,
    position_m=(0.1, -0.2, 1.3), quaternion_xyzw=(0.0, 0.0, 0.6, 0.8),
)  # fmt: skip


def decoded(message: Any) -> Any:
    """A message of the bridge as ROS 2 reads it."""
    return ROS.deserialize_cdr(message.serialize(), message.ROS_NAME)


def seconds(stamp: Any) -> float:
    return float(stamp.sec + 1e-9 * stamp.nanosec)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_types_have_the_names_and_hashes_of_ros(kind: Any) -> None:
    assert ROS.hash_rihs01(kind.ROS_NAME) == kind.ROS_HASH


def test_a_pose_is_stamped_with_the_time_of_its_capture() -> None:
    pose = decoded(ros2_bridge.ros_pose(msgspec.to_builtins(POSE), NOW_S))
    assert seconds(pose.header.stamp) == NOW_S - 0.25
    assert pose.header.frame_id == "world"
    assert (pose.pose.position.x, pose.pose.position.y, pose.pose.position.z) == (0.1, -0.2, 1.3)
    assert (pose.pose.orientation.z, pose.pose.orientation.w) == (0.6, 0.8)


def test_an_occluded_pose_is_not_sent() -> None:
    occluded = msgspec.structs.replace(POSE, occluded=True, position_m=None, quaternion_xyzw=None)
    assert ros2_bridge.ros_pose(msgspec.to_builtins(occluded), NOW_S) is None


@settings(max_examples=20)
@given(wire_maps(Plan))
def test_a_plan_is_a_path_with_a_time_for_every_stage(plan: dict[str, Any]) -> None:
    path = decoded(ros2_bridge.ros_plan(plan, NOW_S))
    stages = msgspec.convert(plan["trajectory"], TrajectoryArray).to_numpy()
    assert len(path.poses) == len(stages)
    for number, (pose, stage) in enumerate(zip(path.poses, stages, strict=True)):
        expected_s = NOW_S + plan["start_s"] + number * plan["period_s"]
        assert abs(seconds(pose.header.stamp) - expected_s) < 1e-6
        position = pose.pose.position
        assert (position.x, position.y, position.z) == pytest.approx(tuple(stage[:3]), abs=1e-9)
        yaw_rad = 2.0 * np.arctan2(pose.pose.orientation.z, pose.pose.orientation.w)
        assert abs(np.exp(1j * yaw_rad) - np.exp(1j * stage[3])) < 1e-9


@settings(max_examples=20)
@given(wire_maps(Command))
def test_a_command_is_a_joystick(command: dict[str, Any]) -> None:
    joystick = decoded(ros2_bridge.ros_command(command, NOW_S))
    assert np.array_equal(joystick.axes, np.array(command["input"], np.float32))
    assert joystick.buttons.size == 0


@given(st.integers(0, 2**62), st.floats(0, 4e9), st.binary(min_size=16, max_size=16))
def test_an_attachment_is_three_named_fields(number: int, now_s: float, publisher: bytes) -> None:
    parts = (
        (b"\x0fsequence_number", number.to_bytes(8, "little")),
        (b"\x10source_timestamp", round(now_s * 1e9).to_bytes(8, "little")),
        (b"\x0asource_gid", b"\x10" + publisher),
    )
    expected = b"".join(name + value for name, value in parts)
    assert ros2_bridge.attachment(number, now_s, publisher) == expected


@pytest.fixture
def ros_router() -> Iterator[BusAddress]:
    with router() as address:
        yield address


def test_a_pose_on_the_bus_arrives_where_ros_listens(
    bus_address: BusAddress, join: Callable[..., Session], ros_router: BusAddress
) -> None:
    key = f"42/{FLEET}/h1/pose/geometry_msgs::msg::dds_::PoseStamped_/{ros_messages.PoseStamped.ROS_HASH}"
    heard: list[Any] = []
    (fleet_endpoint,), (ros_endpoint,) = bus_address.endpoints, ros_router.endpoints
    with zenoh.open(client_config(list(ros_router.endpoints), ros_router.namespace, 5.0)) as ros:
        subscriber = ros.declare_subscriber(key, heard.append)
        # The router of this test has a namespace; that of ROS 2 has none.
        bridge = ros2_bridge.Bridge(
            FLEET, fleet_endpoint, ros_endpoint, domain=42, namespace=bus_address.namespace,
            ros_namespace=ros_router.namespace,
        )  # fmt: skip
        try:
            session = join()
            stopping = threading.Event()

            def publish() -> None:
                while not stopping.wait(0.02):
                    session.publish(channels.POSE, "h1", POSE)

            publisher = threading.Thread(target=publish)
            publisher.start()
            try:
                wait_for(lambda: len(heard) > 1, "no pose arrives")
            finally:
                stopping.set()
                publisher.join()
            tokens = [str(reply.ok.key_expr) for reply in ros.liveliness().get("@ros2_lv/42/**")]
        finally:
            bridge.close()
            subscriber.undeclare()
    pose = ROS.deserialize_cdr(heard[0].payload.to_bytes(), "geometry_msgs/msg/PoseStamped")
    assert pose.pose.position.y == -0.2
    counts = [int.from_bytes(sample.attachment.to_bytes()[16:24], "little") for sample in heard]
    assert counts == list(range(counts[0], counts[0] + len(heard)))
    assert any("/NN/%/%/rcopterx" in token for token in tokens)
    mangled = f"%{FLEET}%h1%pose/geometry_msgs::msg::dds_::PoseStamped_"
    assert any(f"/MP/%/%/rcopterx/{mangled}" in token for token in tokens)


def test_the_bridge_of_dds_listens_to_the_topic_without_its_slash() -> None:
    kind = SimpleNamespace(ROS_NAME="nav_msgs/msg/Path", ROS_HASH="RIHS01_0")
    assert ros2_bridge.ros_key("trio/h1/plan", kind, "ros2dds", 0) == "trio/h1/plan"
    assert ros2_bridge.ros_key("trio/h1/plan", kind, "rmw_zenoh", 0) == (
        "0/trio/h1/plan/nav_msgs::msg::dds_::Path_/RIHS01_0"
    )
