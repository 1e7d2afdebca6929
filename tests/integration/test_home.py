"""Vehicles come home from whatever they fly: clear of each other, to where they took off, and land."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from integration_support import NAMES, Flying, Truth, on_floor

from rcopterx.bus import channels
from rcopterx.control.references.path_shapes import circle

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(240)]

Fly = Callable[..., None]

NEAREST_M = 0.3
HOME_M, NEARBY_M = 0.15, 0.7
WITHIN_S = 30.0


def places(flying: Flying) -> dict[str, np.ndarray]:
    truth = Truth(flying)
    flying.fleet.wait_until(lambda: truth("h1") is not None, 5, "no truth")
    return {name: np.array(vehicle.position_m) for name in NAMES if (vehicle := truth(name)) is not None}


def come_home(
    flying: Flying,
    homes: dict[str, np.ndarray],
    names: tuple[str, ...] = NAMES,
    nearby: tuple[str, ...] = (),
) -> None:
    """Call vehicles home; they are there or nearby in time, and were clear of each other on the way."""
    inbox = flying.fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT, depth=10_000)
    begin_s = flying.now_s()
    flying.fleet.home(names)
    assert flying.now_s() - begin_s < WITHIN_S
    tracks = [received.message.vehicles for received in inbox.drain()]
    assert len(tracks) > 100
    for one, other in combinations(NAMES, 2):
        gaps_m = [np.subtract(at[one].position_m, at[other].position_m) for at in tracks]
        assert np.linalg.norm(gaps_m, axis=1).min() > NEAREST_M, (one, other)
    for name in names:
        away_m = np.linalg.norm(places(flying)[name] - homes[name])
        assert (NEAREST_M < away_m < NEARBY_M) if name in nearby else away_m < HOME_M, name
    truth = Truth(flying)
    flying.fleet.wait_until(lambda: all(on_floor(truth, name) for name in names), 5, "not down", names)


def test_a_leader_on_a_trajectory_and_its_followers_come_home(fly: Fly) -> None:
    fly(leave_a_trajectory)


def leave_a_trajectory(flying: Flying) -> None:
    homes = places(flying)
    flying.fleet.take_off(height_m=0.8, timeout_s=40)
    flying.fleet.wait_for_formation()
    flying.fleet["h1"].fly(circle((0.3, 0.0, 1.0), 0.4, 6.0, turns=3.0))
    flying.fleet.wait(6.0)
    come_home(flying, homes)


def lost(flying: Flying, name: str) -> bool:
    status = flying.fleet.state_of(name).agent
    return status is not None and status.following_mode != "follow"


def test_followers_come_home_after_a_lost_leader(fly: Fly) -> None:
    fly(lose_the_leader)


def lose_the_leader(flying: Flying) -> None:
    homes = places(flying)
    flying.fleet.take_off(height_m=0.8, timeout_s=40)
    flying.fleet.wait_for_formation()
    flying.want("agent-h1", False)
    flying.fleet.wait_until(lambda: lost(flying, "h2") and lost(flying, "h3"), 20, "not lost")
    come_home(flying, homes, ("h2", "h3"))


def test_a_vehicle_whose_place_is_taken_lands_beside_it(fly: Fly) -> None:
    fly(find_the_place_taken)


def find_the_place_taken(flying: Flying) -> None:
    fleet, homes = flying.fleet, places(flying)
    fleet.take_off(height_m=0.8, timeout_s=40)
    for name in ("h2", "h3"):
        fleet[name].lead()
    x, y, _ = homes["h3"]
    fleet["h3"].go_to((-x, -y, 1.4))
    fleet["h3"].wait_for_arrival()
    fleet["h1"].go_to((x, y, 1.0))
    fleet["h1"].wait_for_arrival()
    fleet.land(["h1"])
    come_home(flying, homes | {"h1": places(flying)["h1"]}, nearby=("h3",))
