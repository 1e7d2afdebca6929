"""Promises of the browser view: it shows what the fleet says, and a dragged handle is a set point."""

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest
import viser
from support.bus import free_port
from support.plans import plan_of
from support.scripted import ScriptedVehicle
from support.waiting import wait_for

from bus.messages import LeaderLink, SetPoint
from bus.requests import GoTo
from ground_station.fleet import Fleet
from ground_station.view import FleetView, box_edges, heading_quaternion, plan_segments

Vehicles = dict[str, ScriptedVehicle]


@pytest.fixture
def view(fleet: Fleet) -> Iterator[FleetView]:
    server = viser.ViserServer("127.0.0.1", free_port(), verbose=False)
    try:
        yield FleetView(fleet, server)
    finally:
        server.stop()


def shown(view: FleetView, fleet: Fleet, phase: str) -> None:
    wait_for(lambda: all(vehicle.state.phase == phase for vehicle in fleet), f"not {phase}")
    view.update()


def test_a_plan_is_a_line_through_its_stages() -> None:
    plan = plan_of("h1", position_m=(1.0, 2.0, 3.0))
    segments = plan_segments(plan)
    assert segments.shape == (19, 2, 3)
    assert (segments == [1.0, 2.0, 3.0]).all()
    assert plan_segments(None).shape == (1, 2, 3)


def test_a_box_has_an_edge_along_each_axis_at_every_corner() -> None:
    low, high = np.array([-1.0, -2.0, 0.0]), np.array([1.0, 2.0, 3.0])
    lengths = np.abs(np.diff(box_edges(low, high), axis=1))[:, 0]
    assert sorted(map(tuple, lengths)) == 4 * [(0, 0, 3)] + 4 * [(0, 4, 0)] + 4 * [(2, 0, 0)]


def test_a_heading_is_a_turn_about_the_vertical() -> None:
    assert heading_quaternion(np.pi) == pytest.approx((0.0, 0.0, 0.0, 1.0))


def test_vehicles_are_where_their_agents_say_and_only_flying_leaders_can_be_dragged(
    view: FleetView, fleet: Fleet, vehicles: Vehicles
) -> None:
    shown(view, fleet, "ground")
    assert view["h1"].body.visible
    assert tuple(view["h1"].body.position) == pytest.approx((0.1, 0.2, 0.3))
    assert not view["h1"].handle.visible
    vehicles["h2"].following = (LeaderLink(leader="h1"),)
    for vehicle in vehicles.values():
        vehicle.phase = "flying"
        vehicle.plan_at((0.0, 0.0, 1.0))
    wait_for(lambda: fleet["h2"].state.leaders and fleet["h1"].plan is not None, "no plan")
    shown(view, fleet, "flying")
    assert view["h1"].handle.visible
    assert not view["h2"].handle.visible
    assert view["h1"].plan.points.shape == (19, 2, 3)
    assert tuple(view["h1"].plan_end.position) == pytest.approx((0.0, 0.0, 1.0))
    assert view.links.points == pytest.approx(np.array([[[0.1, 0.2, 0.3], [0.1, 0.2, 0.3]]]))


def test_a_handle_that_is_let_go_is_a_set_point_and_follows_the_fleet_otherwise(
    view: FleetView, fleet: Fleet, vehicles: Vehicles
) -> None:
    vehicles["h1"].phase = "flying"
    vehicles["h1"].set_point = SetPoint(position_m=(0.5, 0.0, 1.0), yaw_rad=2.0)
    wait_for(lambda: (agent := fleet["h1"].state.agent) and agent.set_point.yaw_rad == 2.0, "not known")
    view.update()
    handle = view["h1"].handle
    assert tuple(handle.position) == pytest.approx((0.5, 0.0, 1.0))
    view["h1"].on_drag(SimpleNamespace(phase="start"))
    handle.position = (0.1, -0.2, 1.3)
    view.update()
    assert tuple(handle.position) == pytest.approx((0.1, -0.2, 1.3)), "the hand holds it"
    assert vehicles["h1"].requests == []
    view["h1"].on_drag(SimpleNamespace(phase="end"))
    (request,) = vehicles["h1"].requests
    assert isinstance(request, GoTo)
    assert request.set_point.position_m == pytest.approx((0.1, -0.2, 1.3))
    assert request.set_point.yaw_rad == 2.0
    assert view.answer == "h1: on its way to 0.10, -0.20, 1.30 m"


def test_a_refusal_is_shown_with_its_reason(view: FleetView, vehicles: Vehicles) -> None:
    vehicles["h1"].refusals["go_to"] = "outside"
    view.send("h1", (9.0, 0.0, 1.0), 0.0)
    assert view.answer == "**Refused:** h1: outside"
