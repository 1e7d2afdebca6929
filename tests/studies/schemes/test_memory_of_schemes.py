"""Agents switch garbage collection off: no scheme leaves anything to collect, or keeps what grows."""

import numpy as np
import pytest
from support.garbage import assert_flat
from support.vehicle_types import COAXIAL_LAG
from test_schemes import PERIOD_S, Swarm, at_rest, chain

from rcopterx.control.plugins import SCHEMES
from rcopterx.control.references.trajectory import hold


@pytest.mark.campaign
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", SCHEMES.available())
def test_a_scheme_keeps_nothing_of_its_messages_and_plans(name: str) -> None:
    places_m, leaders = chain((0.0, 0.0, 1.0), (-0.5, 0.4, 1.0))
    swarm = Swarm(name, places_m, leaders)

    def fly(number: int) -> None:
        swarm.age_s = PERIOD_S * (number % 4)
        swarm.goals_m["h1"] = np.array([0.3 * np.sin(0.05 * number), 0.0, 1.0])
        swarm.exchange(number * PERIOD_S)
        for vehicle, scheme in swarm.schemes.items():
            reference = hold(swarm.goals_m[vehicle], 0.0, PERIOD_S, 50)
            scheme.step(at_rest(places_m[vehicle]), reference, COAXIAL_LAG.hover_input)

    assert_flat(fly, 4000)
