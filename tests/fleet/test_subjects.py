"""Tracked subjects that are no vehicles, in a fleet file."""

from functools import partial

import pytest

from rcopterx.bus.access import Seat
from rcopterx.deploy.certificates.seats import host_seats
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.agent import agent_settings
from rcopterx.deploy.roles.tracker import tracker_settings
from rcopterx.fleet.formation_check import check_formation, room_of, start_places
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError

ONE = """
name = "lab"
[vehicles.h1]
subject = "heli1"
transmitter = { port = "radio-h1" }
"""
WAND = ONE + '[subjects.wand]\n[subjects.hand]\nsubject = "right hand"\nmargin_m = 0.2\n'


def test_subjects_have_poses_and_agents_can_follow_them() -> None:
    fleet = parse_fleet(WAND)
    assert tracker_settings(fleet).subjects == {"heli1": "h1", "wand": "wand", "right hand": "hand"}
    assert agent_settings(fleet, "h1").vehicles == ("h1", "wand", "hand")
    assert {"wand", "hand"} < bus_address(fleet, "main").units
    assert list(fleet.vehicles) == ["h1"]


def test_the_vicon_gateway_plans_for_subjects_within_what_vehicles_can_follow() -> None:
    assert tracker_settings(parse_fleet(ONE)).subject_plans is None
    plans = tracker_settings(parse_fleet(WAND)).subject_plans
    assert isinstance(plans, partial)
    margins_m, fastest, period_s = plans.args
    assert margins_m == {"wand": 0.1, "hand": 0.2}
    assert 0.5 < fastest[0] < 2.0
    assert period_s == 0.02


def test_the_host_of_the_tracker_publishes_for_subjects_and_for_nothing_else() -> None:
    for text, names in ((ONE, ("h1",)), (WAND, ("h1", "wand", "hand"))):
        seats = [seat for seat in host_seats(parse_fleet(text), "main") if seat.role == "agent"]
        assert seats == [Seat("agent", (name,), "main") for name in names]


def test_a_vehicle_may_follow_a_subject_from_the_start() -> None:
    follow = 'follow = [{ leader = "wand", offset_m = [-0.9, 0.0, 0.0] }]\n'
    fleet = parse_fleet(ONE + follow + "[subjects.wand]\n[simulator]\n")
    check_formation(fleet, room_of(fleet))
    assert start_places(fleet)["h1"] == (-0.9, 0.0, 0.0, 0.0)
    assert agent_settings(fleet, "h1").following[0].leader == "wand"
    with pytest.raises(FleetError, match=r"follow\[0\]\.leader: unknown vehicle 'wand', known are h1, hand"):
        parse_fleet(ONE + follow + "[subjects.hand]\n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[subjects.h1]", "subjects.h1: the name is reserved"),
        ("[subjects.tracker]", "subjects.tracker: the name is reserved"),
        ("[subjects.heli1]", "subjects.heli1.subject: 'heli1' is already that of vehicles.h1"),
        ("[subjects.wand]\nsize = 2", "subjects.wand: object contains unknown field `size`"),
        ("[subjects.wand]\nmargin_m = -1.0", "subjects.wand.margin_m"),
    ],
)
def test_subjects_that_cannot_be_told_apart_or_understood_are_refused(text: str, words: str) -> None:
    with pytest.raises(FleetError, match=words.replace(".", r"\.")):
        parse_fleet(ONE + text)
