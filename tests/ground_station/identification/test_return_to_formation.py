"""Vehicles of a formation move apart, and return to their places before they follow again."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.scripted import ScriptedVehicle, fleet_file_text, patient_fleet, scripted
from support.waiting import wait_for

from rcopterx.bus.messages import LeaderLink, SetPoint
from rcopterx.bus.session import BusAddress, Session
from rcopterx.fleet.reading import parse_fleet
from rcopterx.ground_station.identification.identification import room_for_all
from rcopterx.ground_station.identification.spacing import IdentificationError
from rcopterx.ground_station.scripting.fleet import Fleet

NAMES = ("h1", "h2", "h3")
PLACES = {"h1": (0.0, 0.0, 1.0), "h2": (-0.35, 0.4, 1.0), "h3": (-0.7, 0.0, 1.0)}
Lab = tuple[Fleet, dict[str, ScriptedVehicle]]


@pytest.fixture
def lab(
    bus_address: BusAddress, join: Callable[..., Session], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Lab]:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    with (
        scripted(join(), *NAMES) as vehicles,
        patient_fleet(parse_fleet(fleet_file_text(bus_address, NAMES))) as fleet,
    ):
        for name, vehicle in vehicles.items():
            vehicle.phase, vehicle.state = "flying", "armed"
            vehicle.plan_at(PLACES[name])
        for name, leader in (("h2", "h1"), ("h3", "h2")):
            vehicles[name].assigned = (LeaderLink(leader=leader, offset_m=(-0.35, 0.0, 0.0)),)
        vehicles["h1"].set_point = SetPoint(position_m=PLACES["h1"], yaw_rad=0.5)
        wait_for(
            lambda: all(state.phase == "flying" for state in map(fleet.state_of, NAMES)), "no status arrives"
        )
        wait_for(lambda: bool(fleet.state_of("h3").assigned), "no leader is known")
        yield fleet, vehicles


def test_all_are_at_their_places_before_they_follow(lab: Lab) -> None:
    fleet, vehicles = lab
    with room_for_all(fleet, NAMES, 0.2) as apart:
        assert apart.reach_m == 0.2
        assert not any(vehicle.assigned for vehicle in vehicles.values())
        places = [vehicle.position_m for vehicle in vehicles.values()]
        assert len({place[:2] for place in places}) == len(NAMES)
    assert apart.not_back == {}
    assert vehicles["h1"].verbs == ["GoTo", "GoTo"]
    assert vehicles["h3"].verbs == ["Lead", "GoTo", "GoTo", "Follow"]
    for name, vehicle in vehicles.items():
        assert vehicle.position_m == pytest.approx(PLACES[name])
    assert vehicles["h1"].set_point.yaw_rad == 0.5, "a head keeps the heading of its set point"
    assert vehicles["h3"].assigned[0].leader == "h2"


def test_a_refused_return_is_noted_and_others_return(lab: Lab) -> None:
    fleet, vehicles = lab
    with room_for_all(fleet, NAMES, None) as apart:
        vehicles["h2"].refusals["follow"] = "h1 is too far away"
    assert list(apart.not_back) == ["h2"]
    assert "h1 is too far away" in apart.not_back["h2"]
    assert vehicles["h3"].assigned[0].leader == "h2"


def test_a_vehicle_that_landed_meanwhile_is_left_out(lab: Lab) -> None:
    fleet, vehicles = lab
    with room_for_all(fleet, NAMES, None):
        before = len(vehicles["h3"].requests)
        vehicles["h3"].phase = "ground"
        wait_for(lambda: fleet.state_of("h3").phase == "ground", "no status arrives")
    assert len(vehicles["h3"].requests) == before
    assert vehicles["h2"].verbs[-1] == "Follow"


def test_vehicles_that_stand_are_named(lab: Lab) -> None:
    fleet, vehicles = lab
    vehicles["h2"].phase = "ground"
    wait_for(lambda: fleet.state_of("h2").phase == "ground", "no status arrives")
    with (
        pytest.raises(IdentificationError, match="h2: must hover"),
        room_for_all(fleet, NAMES, None),
    ):
        pass
