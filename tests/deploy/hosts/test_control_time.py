"""Promises of timing an agent's control period."""

from itertools import count

import pytest
from support.fleets import PAIR

from rcopterx.deploy.hosts.control_time import PERIODS, control_time_s
from rcopterx.deploy.roles.agent import pilot_of
from rcopterx.fleet.reading import parse_fleet
from rcopterx.vehicles.phases import Phase


@pytest.mark.parametrize("vehicle", ["h1", "h2"])
def test_control_periods_in_flight_are_timed_with_pauses_between(vehicle: str) -> None:
    _, pilot = pilot_of(parse_fleet(PAIR), vehicle)
    waited_s: list[float] = []
    clock = count()
    assert control_time_s(pilot, 0.02, waited_s.append, lambda: 1e-3 * next(clock)) == pytest.approx(1e-3)
    assert waited_s == PERIODS * [0.02]
    assert pilot.guidance.phase is Phase.FLYING
