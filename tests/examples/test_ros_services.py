"""Promises of the services for ROS 2, called by an independent client of `rmw_zenoh` (zenoh-ros2-sdk)."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros_support import SET_POINT, FleetDouble, ros2_bridge, ros_commands, ros_messages
from support.bus import FLEET, own_address
from support.waiting import wait_for
from zenoh_ros2_sdk.service_client import ROS2ServiceClient
from zenoh_ros2_sdk.session import ZenohSession
from zenoh_ros2_sdk.utils import compute_service_type_hash

from rcopterx.bus.endpoints import open_session, router_config
from rcopterx.bus.session import BusAddress

TIME, POINT = "int32 sec\nuint32 nanosec\n", "float64 x\nfloat64 y\nfloat64 z\n"
NESTED = {
    "builtin_interfaces/msg/Duration": TIME,
    "builtin_interfaces/msg/Time": TIME,
    "geometry_msgs/msg/Point": POINT,
}
HEIGHT = "uint8 group_mask\nfloat32 height\nbuiltin_interfaces/Duration duration\n"
NOTHING = "# nothing\n"
REQUESTS = {
    ros_messages.Takeoff: HEIGHT,
    ros_messages.Land: HEIGHT,
    ros_messages.GoTo: "uint8 group_mask\nbool relative\ngeometry_msgs/Point goal\nfloat32 yaw\n"
    "builtin_interfaces/Duration duration\n",
    ros_messages.Empty: NOTHING,
}
"""Definitions of the requests, from the files of `crazyflie_interfaces` and `std_srvs`."""


@pytest.mark.parametrize("kind", REQUESTS, ids=lambda kind: kind.__name__)
def test_services_have_the_hashes_of_their_definitions(kind: Any) -> None:
    assert compute_service_type_hash(kind.ROS_NAME, REQUESTS[kind], NOTHING, NESTED) == kind.ROS_HASH


@given(st.sampled_from(list(ros_commands.SERVICES)), st.binary(max_size=80))
def test_other_bytes_are_no_request_and_raise_one_kind_of_error(name: str, payload: bytes) -> None:
    try:
        ros_commands.decoded(ros_commands.SERVICES[name], payload)
    except ros_commands.CommandError:
        return


@pytest.fixture
def called(bus_address: BusAddress) -> Iterator[tuple[FleetDouble, list[str], Callable[..., Any]]]:
    """A fleet that ROS 2 commands, the reports, and a function that calls a service."""
    ros = own_address()
    (endpoint,) = ros.endpoints
    router = open_session(router_config([endpoint], [], None))
    bridge = ros2_bridge.Bridge(
        FLEET, bus_address.endpoints[0], endpoint, domain=42, namespace=bus_address.namespace
    )
    fleet, reports = FleetDouble(), list[str]()
    bridge.obey(fleet, reports.append)
    session = ZenohSession.get_instance("127.0.0.1", int(endpoint.rsplit(":", 1)[1]))
    for name, definition in NESTED.items():
        session.register_message_type(definition, name)

    def call(service: str, **fields: Any) -> Any:
        kind = ros_commands.SERVICES[service.rsplit("/", 1)[1]]
        client = ROS2ServiceClient(
            f"/{FLEET}/{service}", kind.ROS_NAME, REQUESTS[kind], NOTHING, domain_id=42,
            router_port=session.router_port, type_hash=kind.ROS_HASH,
        )  # fmt: skip
        return client.call(**fields)

    yield fleet, reports, call
    session.close()
    bridge.close()
    router.close()


def duration(seconds: int) -> Any:
    return ZenohSession.get_instance().store.types["builtin_interfaces/msg/Duration"](seconds, 0)


def point(*place_m: float) -> Any:
    return ZenohSession.get_instance().store.types["geometry_msgs/msg/Point"](*place_m)


def test_services_of_crazyswarm2_are_answered_and_carried_out(called: Any) -> None:
    fleet, reports, call = called
    limits = {"group_mask": 0, "duration": duration(2)}

    def call_of(service: str, **fields: Any) -> Any:
        before = len(fleet.calls)
        assert call(service, **fields) is not None
        wait_for(lambda: len(fleet.calls) > before, f"no call for {service}")
        return fleet.calls[-1]

    assert call_of("all/takeoff", height=1.5, **limits) == ("take_off", None, 1.5)
    assert call_of("h2/land", height=0.0, **limits) == ("land", ["h2"])
    there = call_of("h1/go_to", relative=False, goal=point(0.1, -0.2, 1.1), yaw=0.5, **limits)
    assert there == ("go_to", "h1", (0.1, -0.2, 1.1), 0.5)
    moved = call_of("h1/go_to", relative=True, goal=point(0.0, 0.5, 0.0), yaw=0.0, **limits)
    assert moved == ("go_to", "h1", (0.5, 0.0, 1.0), SET_POINT.yaw_rad)
    assert call_of("all/emergency") == ("kill", ())
    assert call("h1/takeoff", height=-1.0, **limits) is None
    assert call("h1/go_to", relative=False, goal=point(0.0, 0.0, float("nan")), yaw=0.0, **limits) is None
    wait_for(lambda: len(reports) == 3, "refusals are missing")
    assert reports[1].startswith("takeoff: Expected `float` > 0.1")
    assert reports[2] == "go_to: every number must be finite"


def test_clients_find_the_services(called: Any) -> None:
    ros = ZenohSession.get_instance()
    tokens = [str(reply.ok.key_expr) for reply in ros.liveliness.get("@ros2_lv/42/**")]
    mangled = f"%{FLEET}%all%takeoff/crazyflie_interfaces::srv::dds_::Takeoff_"
    assert any(f"/SS/%/%/rcopterx/{mangled}/" in token for token in tokens)
