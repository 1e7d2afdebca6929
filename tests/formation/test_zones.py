"""Properties of ways and keep-out zones, compared with many points of the ways."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from rcopterx.bus.messages import Zone
from rcopterx.formation.placement import Room, entered
from rcopterx.vehicles.state import Array

SHAPES = ("box", "cylinder")
FINE = 2000  # points of a step
SURELY_M = 0.01  # what goes so deep into a zone is found, and what stays so far away is not

coordinates = st.floats(-1.5, 1.5).map(lambda value: round(value, 3))
ways = st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=4).map(np.array)


@st.composite
def zones(draw: st.DrawFn) -> Zone:
    x, y, z = (draw(coordinates) for _ in range(3))
    sizes = st.floats(0.1, 1.5)
    shape, length, width, height = draw(st.sampled_from(SHAPES)), draw(sizes), draw(sizes), draw(sizes)
    top = x + length, y + (length if shape == "cylinder" else width), z + height
    return Zone(min_m=(x, y, z), max_m=top, shape=shape, margin_m=draw(st.sampled_from((0.0, 0.2))))


def depth_m(zone: Zone, places: Array) -> Array:
    """How deep places, shape (k, 3), are in a zone with its margin; negative outside."""
    low, high = np.array(zone.min_m) - zone.margin_m, np.array(zone.max_m) + zone.margin_m
    depths = np.minimum(places - low, high - places)
    if zone.shape == "cylinder":
        from_axis = np.linalg.norm(places[:, :2] - (low + high)[:2] / 2, axis=1)
        depths[:, :2] = ((high - low)[0] / 2 - from_axis)[:, None]
    return np.asarray(depths.min(axis=1))


def finely(way: Array) -> Array:
    shares = np.linspace(0.0, 1.0, FINE)[:, None]
    return np.vstack([way[:1], *(begin + shares * (end - begin) for begin, end in itertools.pairwise(way))])


@given(zones(), ways)
def test_a_way_that_comes_into_a_zone_is_found_where_it_does_and_no_other(zone: Zone, way: Array) -> None:
    depths = depth_m(zone, finely(way))
    found = entered(zone, way)
    begins_in = np.logical_and.accumulate(depths > 0.0)
    if (depths[~begins_in] > SURELY_M).any() or depths[-1] > SURELY_M:
        assert found is not None
    if (depths < -SURELY_M).all():
        assert found is None
    if found is not None:
        assert depth_m(zone, found[None])[0] >= -1e-5
        to_way = finely(way) - found
        assert np.linalg.norm(to_way, axis=1).min() < SURELY_M


@given(zones(), ways)
def test_a_way_that_begins_in_the_margin_does_not_lead_through_the_zone(zone: Zone, way: Array) -> None:
    depths = depth_m(replace(zone, margin_m=0.0), finely(way))
    begins_in = np.logical_and.accumulate(depths > 0.0)
    if entered(zone, way) is None:
        assert (depths[~begins_in] < SURELY_M).all()


@given(zones(), ways)
def test_a_way_and_its_reverse_meet_the_same_zones_if_they_begin_and_end_outside(
    zone: Zone, way: Array
) -> None:
    if (depth_m(zone, way[[0, -1]]) < -SURELY_M).all():
        assert (entered(zone, way) is None) == (entered(zone, way[::-1]) is None)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_way_may_lead_out_of_a_zone_but_not_back_into_it(shape: str) -> None:
    zone = Zone(min_m=(-0.2, -0.2, 0.0), max_m=(0.2, 0.2, 1.0), shape=shape, margin_m=0.0)
    back = np.array([[0.0, 0.0, 0.5], [0.5, 0.0, 0.5], [0.1, 0.0, 0.5]])
    out = back[:2]
    assert entered(zone, out) is None
    assert entered(zone, back) == pytest.approx((0.2, 0.0, 0.5), abs=SURELY_M)
    assert entered(zone, out[:1]) == pytest.approx(out[0])
    assert entered(zone, out[[0, 0]]) is not None


@pytest.mark.parametrize("shape", SHAPES)
def test_a_way_out_of_the_margin_leads_away_from_the_zone_or_along_it_and_not_through_it(shape: str) -> None:
    zone = Zone(min_m=(-0.2, -0.2, 0.0), max_m=(0.2, 0.2, 1.0), shape=shape)
    begin = (-0.3, 0.0, 0.5)
    assert entered(zone, np.array([begin, (-1.0, 0.0, 0.5)])) is None
    assert entered(zone, np.array([begin, (-0.3, 1.0, 0.5)])) is None
    assert entered(zone, np.array([begin, (1.0, 0.0, 0.5)])) == pytest.approx((-0.2, 0.0, 0.5), abs=SURELY_M)


def test_only_zones_that_no_way_begins_beside_become_larger_as_a_room_shrinks() -> None:
    zone = Zone(min_m=(-0.2, -0.2, 0.0), max_m=(0.2, 0.2, 1.0))
    far = replace(zone, min_m=(-2.0, -0.2, 0.0), max_m=(-1.6, 0.2, 1.0))
    room = Room((-3.0, -3.0, 0.0), (3.0, 3.0, 2.0), zones={"near": zone, "far": far})
    shrunk = room.shrunk(0.1, [np.array((0.45, 0.0, 0.5))])
    assert shrunk.max_m == pytest.approx((2.9, 2.9, 1.9))
    assert {name: zone.margin_m for name, zone in shrunk.zones.items()} == pytest.approx(
        {"near": 0.2, "far": 0.3}
    )


def test_the_corner_of_a_box_is_beside_the_cylinder_in_it() -> None:
    place = np.array([[0.45, 0.45, 0.5]])
    for shape, inside in (("box", True), ("cylinder", False)):
        zone = Zone(min_m=(-0.5, -0.5, 0.0), max_m=(0.5, 0.5, 1.0), shape=shape, margin_m=0.0)
        assert (entered(zone, place) is not None) is inside


def test_a_way_along_the_margin_is_free() -> None:
    zone = Zone(min_m=(0.0, -0.2, 0.0), max_m=(0.4, 0.2, 1.0))
    assert entered(zone, np.array([[-1.0, 0.4, 0.5], [1.0, 0.4, 0.5]])) is None
    assert entered(zone, np.array([[-1.0, 0.39, 0.5], [1.0, 0.39, 0.5]])) == pytest.approx(
        (-0.2, 0.39, 0.5), abs=SURELY_M
    )


ROOM = Room(
    (-1.0, -1.0, 0.0), (1.0, 1.0, 2.0), zones={"table": Zone(min_m=(0.2, 0.2, 0.0), max_m=(0.6, 0.6, 0.8))}
)


@pytest.mark.parametrize(
    ("way", "words"),
    [
        ([(0.0, 0.0, 1.0)], None),
        ([(0.0, 1.2, 1.0)], "y: 1.2 m is outside the flight volume -1 .. 1 m"),
        (
            [(0.0, 0.9, 1.0), (0.0, 1.5, 1.0), (0.0, 1.1, 1.0)],
            "y: 1.5 m is outside the flight volume -1 .. 1 m",
        ),
        ([(0.0, 1.2, 1.0), (0.0, 0.9, 1.0)], None),
        (
            [(0.0, 1.2, 1.0), (0.0, 0.9, 1.0), (0.0, 0.9, 2.1)],
            "z: 2.1 m is outside the flight volume 0 .. 2 m",
        ),
        ([(0.4, 0.4, 0.9)], "(0.40, 0.40, 0.90) m is not 0.2 m clear of the keep-out zone table"),
        ([(0.4, 0.4, 1.1)], None),
        (
            [(-0.5, 0.4, 0.5), (0.9, 0.4, 0.5)],
            "(0.01, 0.40, 0.50) m is not 0.2 m clear of the keep-out zone table",
        ),
    ],
)
def test_a_room_has_one_check_of_volume_and_zones(
    way: list[tuple[float, float, float]], words: str | None
) -> None:
    assert ROOM.outside(np.array(way)) == words


def test_a_shrunk_room_is_that_of_what_reaches_beyond_its_place() -> None:
    assert (
        ROOM.shrunk(0.3).outside(np.array([0.0, 0.8, 1.0]))
        == "y: 0.8 m is outside the flight volume -0.7 .. 0.7 m"
    )
    assert "not 0.5 m clear" in (ROOM.shrunk(0.3).outside(np.array([0.4, 0.4, 1.2])) or "")


@given(
    zones(),
    st.tuples(coordinates, coordinates, coordinates),
    st.tuples(coordinates, coordinates, coordinates),
)
def test_a_place_is_free_with_a_follower_beside_it_exactly_if_both_places_are_free(
    zone: Zone, place_m: tuple[float, float, float], offset_m: tuple[float, float, float]
) -> None:
    room = Room((-1.5, -1.5, 0.0), (1.5, 1.5, 2.0), zones={"zone": zone})
    own, beside = np.array(place_m), np.array(place_m) + offset_m
    free = room.outside(own) is None and room.outside(beside) is None
    assert (room.with_beside([np.array(offset_m)]).outside(own) is None) == free
