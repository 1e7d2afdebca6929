"""Promises of a fleet file's formation: it fits into the volume, and vehicles keep their distance."""

from dataclasses import replace

import pytest
from support.fleets import PAIR

from rcopterx.deploy.roles.agent import agent_settings
from rcopterx.fleet.formation_check import check_formation, room_of
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetError

THIRD = """
[vehicles.h3]
subject = "heli3"
transmitter = { port = "radio-h3", model_match = 3 }
follow = [{ leader = "h2", offset_m = [%s] }]
"""


@pytest.mark.parametrize(
    ("offset", "words"),
    [
        ("0.1, 0.0, 0.1", r"^vehicles\.h3\.follow: h2 and h3 would be 0\.141 m apart, the minimum .* 0\.3 m"),
        ("0.4, -0.4, 0.0", r"^vehicles\.h3\.follow: h1 and h3 would be 0\.1 m apart"),
        (
            "-2.1, 0.0, 0.0",
            r"h1 and h3 would be 2\.5 m apart in x, the flight volume is 2\.4 m there",
        ),
        ("0.4, 0.0, 2.2", r"^vehicles\.h3\.follow: h1 and h3 would be 2\.2 m apart in z"),
    ],
)
def test_formations_that_cannot_be_flown_are_refused(offset: str, words: str) -> None:
    with pytest.raises(FleetError, match=words):
        check_formation(fleet := parse_fleet(PAIR + THIRD % offset), room_of(fleet))


def test_formations_with_room_are_taken_and_so_are_close_ones_without_a_limit() -> None:
    check_formation(fleet := parse_fleet(PAIR + THIRD % "0.4, 0.4, 0.2"), room_of(fleet))
    close = parse_fleet(PAIR + THIRD % "0.1, 0.0, 0.1")
    check_formation(close, replace(room_of(close), minimum_distance_m=None))


ZONE = "\n[zones.table]\nmin_m = %s\nmax_m = %s\n"


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (
            "[-0.1, -0.1, 0.0]",
            "[0.1, 0.1, 0.5]",
            r"^vehicles\.h1: where it stands: \(0\.00, 0\.00, 0\.00\) m is .* zone table$",
        ),
        (
            "[-0.9, 0.4, 0.9]",
            "[-0.5, 0.6, 1.0]",
            r"^vehicles\.h2: where it flies in formation: .* zone table$",
        ),
    ],
)
def test_vehicles_neither_stand_nor_fly_in_a_zone(low: str, high: str, words: str) -> None:
    with pytest.raises(FleetError, match=words):
        check_formation(fleet := parse_fleet(PAIR + ZONE % (low, high)), room_of(fleet))
    beside = ZONE % ("[0.5, 0.5, 0.0]", "[0.9, 0.9, 2.0]")
    check_formation(fleet := parse_fleet(PAIR + beside), room_of(fleet))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('successors = ["h9"]', r"vehicles\.h1\.successors\[0\]: 'h9' cannot succeed h1, allowed are h2"),
        ('successors = ["h1"]', r"vehicles\.h1\.successors\[0\]: 'h1' cannot succeed h1"),
        ('successors = ["h2"]', r'h2 does not want to lead; give it leader_lost\.then = "promote"'),
        ('leader_lost = { then = "pray" }', r"vehicles\.h1\.leader_lost\.then: "),
        ("leader_lost = { after_s = 0.1 }", r"vehicles\.h1\.leader_lost\.after_s: "),
    ],
)
def test_impossible_successions_are_refused(line: str, words: str) -> None:
    with pytest.raises(FleetError, match=words):
        parse_fleet(PAIR.replace('subject = "heli1"', f'subject = "heli1"\n{line}'))


def test_every_agent_knows_the_same_order_of_successors() -> None:
    text = PAIR.replace('subject = "heli1"', 'subject = "heli1"\nsuccessors = ["h3"]') + THIRD % "0.4, 0.4, 0"
    fleet = parse_fleet('defaults.leader_lost = { then = "promote", after_s = 3 }\n' + text)
    orders = [agent_settings(fleet, name).succession.orders for name in fleet.vehicles]
    assert orders[0] == orders[1] == orders[2]
    assert orders[0]["h1"] == ("h3", "h1", "h2")
    assert agent_settings(fleet, "h2").succession.policy == "promote"
    assert agent_settings(fleet, "h2").succession.after_s == 3
