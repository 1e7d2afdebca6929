"""Promises of the page: it shows what a (scripted) fleet says, and asks for what is done on it."""

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.bus import free_port
from support.scripted import ScriptedVehicle
from support.waiting import wait_for

from rcopterx.bus.messages import LeaderLink, SetPoint
from rcopterx.bus.requests import Follow, GoTo, Tune
from rcopterx.control.controllers.cascade.weights import default_weights
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.page.guard import PageServer
from rcopterx.ground_station.page.page import FleetPage, PageFrame
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.vehicles.model import IDENTIFIED, with_parameters

Vehicles = dict[str, ScriptedVehicle]
BY_HAND = SimpleNamespace(client=object())


@pytest.fixture
def opened(fleet: Fleet, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., FleetPage]]:
    """Open pages; answers to their users are in `notices`."""
    server = PageServer(free_port(), "lab", "key-of-this-test")
    monkeypatch.setattr(FleetPage, "notify", lambda page, text, refused: notices.append((text, refused)))
    notices.clear()
    try:
        yield lambda **options: FleetPage(fleet, PageFrame(server, fleet.file.name, **options))
    finally:
        server.stop()


@pytest.fixture
def page(opened: Callable[..., FleetPage]) -> FleetPage:
    return opened()


notices: list[tuple[str, bool]] = []


def test_browsers_are_told_to_wait_until_the_fleet_is_there(fleet: Fleet) -> None:
    server = PageServer(free_port(), "lab", "key-of-this-test")
    try:
        frame = PageFrame(server, fleet.file.name)
        assert "waiting for the fleet" in server.pages[""]()
        FleetPage(fleet, frame).update(time.monotonic())
        assert "waiting for the fleet" not in server.pages[""]()
    finally:
        server.stop()


def shown(page: FleetPage, fleet: Fleet, phase: str) -> None:
    wait_for(lambda: all(vehicle.state.phase == phase for vehicle in fleet), f"not {phase}")
    draw(page)


def fly(vehicles: Vehicles) -> None:
    for vehicle in vehicles.values():
        vehicle.phase, vehicle.state = "flying", "armed"
        vehicle.plan_at((0.0, 0.0, 1.0))
        vehicle.position_m = (0.1, 0.2, 0.3)


def draw(page: FleetPage) -> None:
    """Every line is drawn in one of two pictures."""
    for _ in range(2):
        page.update(time.monotonic())


def test_vehicles_are_where_their_agents_say_with_plans_references_and_lines_to_their_leaders(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles
) -> None:
    shown(page, fleet, "ground")
    shape = page.scene["h1"]
    assert shape.body.visible
    assert tuple(shape.body.position) == pytest.approx((0.1, 0.2, 0.3))
    assert not shape.handle.visible
    vehicles["h2"].following = vehicles["h2"].assigned = (LeaderLink(leader="h1"),)
    fly(vehicles)
    wait_for(lambda: fleet["h2"].state.leaders and fleet["h1"].plan is not None, "no plan")
    shown(page, fleet, "flying")
    assert shape.handle.visible
    assert shape.reference.visible
    assert shape.plan.points.shape == (19, 2, 3)
    assert tuple(shape.plan_end.position) == pytest.approx((0.0, 0.0, 1.0))
    assert page.scene.links.points == pytest.approx(np.array([[[0.1, 0.2, 0.3], [0.1, 0.2, 0.3]]]))


def test_a_leaders_handle_that_is_let_go_is_a_set_point(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles
) -> None:
    fly(vehicles)
    vehicles["h1"].set_point = SetPoint(position_m=(0.5, 0.0, 1.0), yaw_rad=2.0)
    wait_for(lambda: (agent := fleet["h1"].state.agent) and agent.set_point.yaw_rad == 2.0, "not known")
    shown(page, fleet, "flying")
    shape = page.scene["h1"]
    assert tuple(shape.handle.position) == pytest.approx((0.5, 0.0, 1.0))
    shape.on_drag(SimpleNamespace(phase="start"))
    shape.handle.position = (0.1, -0.2, 1.3)
    draw(page)
    assert tuple(shape.handle.position) == pytest.approx((0.1, -0.2, 1.3)), "the hand holds it"
    assert vehicles["h1"].requests == []
    shape.on_drag(SimpleNamespace(phase="end"))
    (request,) = vehicles["h1"].requests
    assert isinstance(request, GoTo)
    assert request.set_point.position_m == pytest.approx((0.1, -0.2, 1.3))
    assert request.set_point.yaw_rad == 2.0
    assert notices == [("h1: on its way to 0.10, -0.20, 1.30 m", False)]


def test_a_followers_handle_is_its_place_beside_its_leader(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles
) -> None:
    link = LeaderLink(leader="h1", offset_m=(0.0, 1.0, 0.0))
    vehicles["h2"].following = vehicles["h2"].assigned = (link,)
    fly(vehicles)
    wait_for(lambda: fleet["h2"].state.assigned, "not known")
    shown(page, fleet, "flying")
    shape = page.scene["h2"]
    assert tuple(shape.handle.position) == pytest.approx((0.1, 1.2, 0.3))
    shape.on_drag(SimpleNamespace(phase="start"))
    shape.handle.position = (0.6, 1.2, 0.3)
    shape.on_drag(SimpleNamespace(phase="end"))
    (request,) = vehicles["h2"].requests
    assert isinstance(request, Follow)
    assert request.following[0].offset_m == pytest.approx((0.5, 1.0, 0.0))


def test_a_page_that_only_watches_has_nothing_to_drag(
    opened: Callable[..., FleetPage], fleet: Fleet, vehicles: Vehicles
) -> None:
    page = opened(steers=False)
    fly(vehicles)
    shown(page, fleet, "flying")
    assert page.steering is None
    assert not page.scene["h1"].handle.visible


def test_a_refusal_is_shown_with_its_reason(page: FleetPage, vehicles: Vehicles) -> None:
    assert page.steering is not None
    vehicles["h1"].refusals["go_to"] = "outside"
    page.steering.go_to("h1", (9.0, 0.0, 1.0), 0.0)
    assert notices == [("h1: outside", True)]


def test_kill_cuts_everybody_also_while_another_request_waits(page: FleetPage, vehicles: Vehicles) -> None:
    assert page.steering is not None
    page.steering.kill()
    assert {vehicle.state for vehicle in vehicles.values()} == {"killed"}
    page.steering.reset()
    assert {vehicle.state for vehicle in vehicles.values()} == {"disarmed"}


def test_take_off_and_landing_are_asked_of_everybody(page: FleetPage, vehicles: Vehicles) -> None:
    assert page.steering is not None
    page.steering.take_off()
    assert {vehicle.phase for vehicle in vehicles.values()} == {"flying"}
    page.steering.land()
    assert {vehicle.phase for vehicle in vehicles.values()} == {"ground"}
    assert [refused for _, refused in notices] == [False, False]


def test_a_leader_that_is_chosen_is_followed_from_where_the_vehicle_is(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles
) -> None:
    fly(vehicles)
    vehicles["h2"].position_m = (0.1, 1.2, 0.3)
    wait_for(lambda: (agent := fleet["h2"].state.agent) and agent.position_m == (0.1, 1.2, 0.3), "not there")
    controls = page.vehicles["h2"]
    controls.leader.value = "h1"
    controls.on_leader(BY_HAND)
    (request,) = vehicles["h2"].requests
    assert isinstance(request, Follow)
    assert request.following[0].offset_m == pytest.approx((0.0, 1.0, 0.0))


def test_what_others_choose_is_shown_and_asks_for_nothing(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles
) -> None:
    vehicles["h2"].following = vehicles["h2"].assigned = (LeaderLink(leader="h1"),)
    fly(vehicles)
    wait_for(lambda: fleet["h2"].state.assigned, "not known")
    shown(page, fleet, "flying")
    assert page.vehicles["h2"].leader.value == "h1"
    page.vehicles["h2"].on_leader(SimpleNamespace(client=None))
    assert vehicles["h2"].requests == []


def test_a_formation_is_flown_by_all_that_fly(page: FleetPage, fleet: Fleet, vehicles: Vehicles) -> None:
    assert page.steering is not None
    page.steering.formation("line", "h1", 0.8)
    assert notices == [("h1 does not fly", True)]
    fly(vehicles)
    wait_for(lambda: all(vehicle.state.phase == "flying" for vehicle in fleet), "not flying")
    page.steering.formation("line", "h1", 0.8)
    (request,) = vehicles["h2"].requests
    assert isinstance(request, Follow)
    assert request.following[0].offset_m == pytest.approx((0.0, 0.8, 0.0))


def test_waypoints_are_flown_from_where_the_vehicle_is_and_none_is_a_refusal(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles
) -> None:
    page.waypoints.fly()
    assert notices == [("click waypoints in the scene first", True)]
    for x in (0.5, 1.0):
        page.waypoints.add((x, 0.0, 3.0), (0.0, 0.0, -1.0))
    assert page.waypoints.places == [(0.5, 0.0, 1.0), (1.0, 0.0, 1.0)]
    page.waypoints.clear()
    assert page.waypoints.places == []


def tunings(page: FleetPage, monkeypatch: pytest.MonkeyPatch) -> list[Tune]:
    """Requests to tune that the page sends from now on; all succeed."""
    requests: list[Tune] = []

    def tune(name: str, controller: str | None = None, **settings: object) -> bool:
        requests.append(Tune(controller=controller, controller_settings=settings))  # type: ignore[arg-type]
        return True

    monkeypatch.setattr(page.steering, "tune", tune)
    return requests


def report(fleet: Fleet, vehicle: ScriptedVehicle, **diagnostics: Any) -> None:
    """Report other diagnostics of a vehicle, and wait until the fleet has them."""
    vehicle.diagnostics |= diagnostics
    wait_for(
        lambda: (
            (agent := fleet[vehicle.name].state.agent)
            and all(getattr(agent.diagnostics, name) == value for name, value in diagnostics.items())
        ),
        "no report",
    )


def test_weights_are_factors_of_the_defaults_and_undo_brings_the_last_ones_back(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    report(fleet, vehicles["h1"], controller="cascade")
    requests = tunings(page, monkeypatch)
    weights = page.vehicles["h1"].weights
    weights.on_undo()
    assert requests == [], "there is nothing to undo"
    weights.sliders["position"].value = 1.0
    weights.on_apply()
    weights.on_undo()
    doubled, default = (np.array(one.controller_settings["state_weights"]) for one in requests)
    assert doubled / default == pytest.approx([2, 2, 2, 1, 1, 1, 1, 1])
    assert weights.sliders["position"].value == 0.0
    weights.on_undo()
    assert len(requests) == 2, "there is nothing more to undo"


def test_weights_of_identified_vehicles_are_factors_of_those_of_the_identified_model(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = model_of(fleet.file, "h1")
    found = {"uncertainty": asdict(IDENTIFIED)}
    report(fleet, vehicles["h1"], controller="cascade", model=found)
    requests = tunings(page, monkeypatch)
    page.vehicles["h1"].weights.on_apply()
    expected = default_weights(with_parameters(model, found), fleet.file.vehicles["h1"].control.period_s)
    assert requests[0].controller_settings["input_weights"] == pytest.approx(expected.inputs)
    assert requests[0].controller_settings["state_weights"] == pytest.approx(expected.states)


@pytest.mark.parametrize("controller", ["cascade", "lqr"])
def test_undo_restores_what_the_vehicle_flew_with_before(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles, monkeypatch: pytest.MonkeyPatch, controller: str
) -> None:
    flown = {"input_weights": (20.0, 20.0, 30.0, 200.0), "horizon": 30}
    report(fleet, vehicles["h1"], controller=controller, controller_settings=flown)
    requests = tunings(page, monkeypatch)
    weights = page.vehicles["h1"].weights
    weights.on_apply()
    weights.on_undo()
    assert requests[0].controller == "cascade"
    assert requests[1].controller == controller
    assert requests[1].controller_settings.items() >= flown.items()


def test_ellipsoids_of_uncertainty_are_there_if_they_are_wanted_and_told(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles
) -> None:
    fly(vehicles)
    vehicles["h1"].diagnostics["position_deviation_m"] = (0.0005, 0.0005, 0.001)
    wait_for(
        lambda: (agent := fleet["h1"].state.agent) and agent.diagnostics.position_deviation_m, "not told"
    )
    shown(page, fleet, "flying")
    assert not page.scene["h1"].uncertainty.visible
    page.scene.uncertainty.value = True
    draw(page)
    ellipsoid = page.scene["h1"].uncertainty
    assert ellipsoid.visible
    assert not page.scene["h2"].uncertainty.visible
    assert tuple(ellipsoid.position) == pytest.approx((0.1, 0.2, 0.3))
    assert ellipsoid.scale == pytest.approx((0.1, 0.1, 0.2))


def test_arrows_of_the_wind_are_there_if_they_are_wanted_and_known(
    page: FleetPage, fleet: Fleet, vehicles: Vehicles
) -> None:
    fly(vehicles)
    vehicles["h1"].diagnostics["wind_m_s2"] = (0.3, 0.0)
    wait_for(lambda: (agent := fleet["h1"].state.agent) and agent.diagnostics.wind_m_s2, "no wind")
    shown(page, fleet, "flying")
    assert not page.scene["h1"].wind.visible
    page.scene.wind.value = True
    draw(page)
    assert page.scene["h1"].wind.visible
    assert not page.scene["h2"].wind.visible
    start, end = page.scene["h1"].wind.points[0]
    assert end - start == pytest.approx([0.3, 0.0, 0.0], abs=1e-6)
