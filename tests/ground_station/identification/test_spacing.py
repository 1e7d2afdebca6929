"""Vehicles that are excited at the same time have room around them, within the flight volume."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus.messages import Zone
from rcopterx.fleet.formation_check import room_of
from rcopterx.fleet.reading import fleet_path, load_fleet, shipped_fleets
from rcopterx.formation.placement import Room
from rcopterx.ground_station.identification.spacing import IdentificationError, spread, usual_reach
from rcopterx.vehicles.tuples import Three

REACH_M, DISTANCE_M = 0.25, 0.3
ROOM = Room((-3.0, -2.0, 0.0), (3.0, 2.0, 2.0), DISTANCE_M)
coordinates = st.floats(-3.0, 3.0)
places = st.lists(st.tuples(coordinates, coordinates, st.floats(0.0, 2.0)), min_size=1, max_size=12)


def named(found: list[Three]) -> dict[str, Three]:
    return {f"h{index}": place for index, place in enumerate(found)}


@given(places)
def test_vehicles_have_room_around_them(found: list[Three]) -> None:
    apart = spread(named(found), REACH_M, ROOM)
    assert list(apart) == list(named(found))
    for (ax, ay, _), (bx, by, _) in combinations(apart.values(), 2):
        assert max(abs(ax - bx), abs(ay - by)) >= DISTANCE_M + 2 * REACH_M - 1e-9
    for place in apart.values():
        for value, low, high in zip(place, ROOM.min_m, ROOM.max_m, strict=True):
            assert low + REACH_M <= value <= high - REACH_M


@given(places)
def test_ways_do_not_meet(found: list[Three]) -> None:
    before, after = (
        np.array(list(one.values()))[:, :2] for one in (named(found), spread(named(found), REACH_M, ROOM))
    )
    for first, second in combinations(range(len(found)), 2):
        # Of two vehicles that exchange their points, neither order has a shorter sum of squares.
        assert (before[first] - before[second]) @ (after[first] - after[second]) >= -1e-9


def test_a_formation_with_room_stays_where_it_is() -> None:
    wide: dict[str, Three] = {"h1": (0.0, 0.0, 1.0), "h2": (1.0, 0.0, 1.0)}
    assert spread(wide, REACH_M, ROOM) == wide


def test_heights_stay_where_the_volume_has_room() -> None:
    apart = spread({"h1": (0.0, 0.0, 1.1), "h2": (0.0, 0.0, 0.1)}, REACH_M, ROOM)
    assert apart["h1"][2] == 1.1
    assert REACH_M < apart["h2"][2] < REACH_M + 0.05


@pytest.mark.parametrize("name", shipped_fleets())
def test_delivered_fleets_have_room(name: str) -> None:
    fleet = load_fleet(fleet_path(name))
    crowded = {vehicle: (0.01 * index, 0.0, 1.0) for index, vehicle in enumerate(fleet.vehicles)}
    room = room_of(fleet)
    reach_m = usual_reach(len(crowded), room)
    assert 0.15 <= reach_m <= 0.25
    spread(crowded, reach_m, room)


@pytest.mark.parametrize(
    ("corner_m", "count"),
    [((0.6, 0.6, 2.0), 1), ((1.2, 0.6, 2.0), 3), ((0.2, 0.6, 2.0), 0), ((2.0, 2.0, 0.2), 0)],
)
def test_a_volume_that_is_too_small_is_an_error_with_the_number_that_fits(
    corner_m: Three, count: int
) -> None:
    low_m = (-corner_m[0], -corner_m[1], 0.0)
    crowd = named([(0.1 * index, 0.0, 1.0) for index in range(9)])
    with pytest.raises(IdentificationError, match=f"room for {count} excited vehicles, not for 9"):
        spread(crowd, REACH_M, Room(low_m, corner_m, DISTANCE_M))


def test_vehicles_are_excited_beside_keep_out_zones() -> None:
    zone = Zone(min_m=(-0.5, -0.5, 0.0), max_m=(0.5, 0.5, 0.4))
    room = replace(ROOM, zones={"table": zone})
    crowd = named([(0.1 * index, 0.0, 1.0) for index in range(9)])
    for place in spread(crowd, REACH_M, room).values():
        assert room.shrunk(REACH_M).outside(np.array(place)) is None
        assert max(abs(value) for value in place[:2]) > 0.5 + zone.margin_m + REACH_M
