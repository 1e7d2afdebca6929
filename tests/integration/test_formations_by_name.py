"""Formations by name: vehicles get their places one after the other, clear of each other."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from integration_support import NAMES, Flying

from rcopterx.bus import channels

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(240)]

NEAREST_M = 0.3


def test_vehicles_change_places_although_these_are_taken_at_first(fly: Callable[..., None]) -> None:
    fly(change_places)


def change_places(flying: Flying) -> None:
    fleet = flying.fleet
    fleet.take_off(height_m=0.8, timeout_s=40)
    fleet.wait_for_formation()
    inbox = fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT, depth=10_000)
    assert len(fleet.form("line", "h1", 0.5, assign=True)) == 2
    fleet.wait_for_formation(timeout_s=20)
    given = {name: fleet[name].state.assigned[0].offset_m for name in ("h2", "h3")}
    assert sorted(given.values()) == [(0.0, -0.5, 0.0), (0.0, 0.5, 0.0)]
    assert fleet.form("line", "h1", 0.5, assign=True), "nothing to change"
    assert {name: fleet[name].state.assigned[0].offset_m for name in ("h2", "h3")} == given
    fleet.form("column", "h1", 0.5)  # the place of h3 is behind that of h2
    fleet.wait_for_formation(timeout_s=20)
    assert fleet["h3"].state.assigned[0].offset_m == (-1.0, 0.0, 0.0)
    for received in inbox.drain():
        at = received.message.vehicles
        for one, other in combinations(NAMES, 2):
            assert np.linalg.norm(np.subtract(at[one].position_m, at[other].position_m)) > NEAREST_M
