"""Tracked subjects that are no vehicles, in a fleet file."""

import pytest

from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.deploy.roles.agent import agent_settings
from rcopterx.deploy.roles.tracker import tracker_settings
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
    assert agent_settings(fleet, "h1").subjects == ("wand", "hand")
    assert {"wand", "hand"} < bus_address(fleet, "main").units
    assert list(fleet.vehicles) == ["h1"]


def test_the_vicon_gateway_plans_for_subjects_within_what_vehicles_can_follow() -> None:
    assert tracker_settings(parse_fleet(ONE)).planned is None
    planned = tracker_settings(parse_fleet(WAND)).planned
    assert planned is not None
    assert planned.margins_m == {"wand": 0.1, "hand": 0.2}
    assert planned.limits is not None
    assert 0.5 < planned.limits.rate[0] < 2.0


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
