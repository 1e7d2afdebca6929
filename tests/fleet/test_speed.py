"""Promises of the speed of a fleet: simulated ones fly at any, hardware in real time."""

from pathlib import Path

import pytest
from support.fleets import HARDWARE_PAIR, PAIR

from rcopterx.bus.clock import Clock
from rcopterx.fleet.reading import at_speed, digest_of, load_fleet, parse_fleet, write_snapshot
from rcopterx.fleet.schema import FleetError

SLOW = PAIR.replace("[simulator]", "[simulator]\nspeed = 0.5")


def test_a_fleet_flies_in_real_time_unless_its_file_or_its_user_says_otherwise() -> None:
    assert parse_fleet(PAIR).clock == parse_fleet(HARDWARE_PAIR).clock == Clock()
    assert parse_fleet(SLOW).clock == Clock(0.5)
    assert at_speed(parse_fleet(SLOW), 0.2).clock == Clock(0.2)
    assert at_speed(parse_fleet(SLOW), None) == parse_fleet(SLOW)
    assert at_speed(parse_fleet(SLOW), 1.0) == parse_fleet(PAIR)


def test_processes_and_programs_that_join_use_the_same_speed(tmp_path: Path) -> None:
    fleet = at_speed(parse_fleet(PAIR), 0.2)
    write_snapshot(fleet, tmp_path / "fleet.json")
    assert load_fleet(tmp_path / "fleet.json").clock == fleet.clock
    assert digest_of(fleet) != digest_of(parse_fleet(PAIR))


@pytest.mark.parametrize("speed", [0.2, 0.999, 2.0])
def test_hardware_refuses_any_speed_but_real_time(speed: float) -> None:
    fleet = parse_fleet(HARDWARE_PAIR)
    with pytest.raises(FleetError, match=f"speed {speed:g}: .* flies hardware, which needs real time"):
        at_speed(fleet, speed)
    assert at_speed(fleet, 1.0) is fleet


@pytest.mark.parametrize("speed", [0.0, -1.0, 0.001, 11.0, float("nan")])
def test_a_speed_out_of_range_is_refused(speed: float) -> None:
    with pytest.raises(FleetError, match=r"allowed is 0\.01 to 10"):
        at_speed(parse_fleet(PAIR), speed)


def test_the_title_names_the_speed_of_slow_motion_only() -> None:
    assert parse_fleet(PAIR).title == "lab"
    assert parse_fleet(SLOW).title == "lab (0.5 x real time)"
