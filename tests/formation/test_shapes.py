"""Promises of the formations by name: every vehicle has a place, and none is nearer than requested."""

from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.formation.shapes import SHAPES, ShapeName, assigned, formation_links


@given(st.sampled_from(sorted(SHAPES)), st.integers(0, 11), st.floats(0.5, 1.5))
def test_vehicles_of_a_formation_are_as_far_apart_as_asked(
    shape: ShapeName, count: int, spacing_m: float
) -> None:
    names = [f"h{number}" for number in range(2, 2 + count)]
    links = formation_links(shape, "h1", names, spacing_m)
    assert list(links) == names
    assert {link.leader for link in links.values()} <= {"h1"}
    assert {link.frame for link in links.values()} <= {"heading"}
    places = [np.zeros(3), *(np.array(link.offset_m) for link in links.values())]
    for one, other in combinations(places, 2):
        assert np.linalg.norm(one - other) >= spacing_m * (1.0 - 1e-9)


@pytest.mark.parametrize(
    ("shape", "places"),
    [
        ("line", [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 2.0, 0.0)]),
        ("column", [(-1.0, 0.0, 0.0), (-2.0, 0.0, 0.0), (-3.0, 0.0, 0.0)]),
    ],
)
def test_a_line_stands_beside_its_leader_and_a_column_behind(
    shape: ShapeName, places: list[tuple[float, float, float]]
) -> None:
    links = formation_links(shape, "h1", ["h2", "h3", "h4"], 1.0)
    assert [link.offset_m for link in links.values()] == places


NUMBERS = st.floats(-2.0, 2.0).map(lambda value: round(value, 2))
PLACES = st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=5, max_size=5)


@given(PLACES, PLACES, st.integers(0, 5))
def test_no_other_assignment_has_a_shorter_longest_way_or_as_long_a_one_and_less_in_all(
    present: list[tuple[float, float, float]], places: list[tuple[float, float, float]], count: int
) -> None:
    present_m, places_m = (np.array(each[:count]).reshape(-1, 3) for each in (present, places))

    def ways_m(order: tuple[int, ...]) -> np.ndarray:
        return np.linalg.norm(present_m - places_m[list(order)], axis=1)

    given_m = ways_m(tuple(assigned(present_m, places_m)))
    for order in permutations(range(count)):
        other_m = ways_m(order)
        assert given_m.max(initial=0.0) <= other_m.max(initial=0.0) + 1e-9
        if other_m.max(initial=0.0) < given_m.max(initial=0.0) + 1e-9:
            assert given_m.sum() <= other_m.sum() + 1e-6


def test_followers_that_stand_at_their_places_keep_them() -> None:
    present = np.array([(0.0, -2.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 2.0, 0.0)])
    names = ["h2", "h3", "h4", "h5"]
    links = formation_links("line", "h1", names, 1.0, present)
    assert [link.offset_m for link in links.values()] == [tuple(place) for place in present.tolist()]
