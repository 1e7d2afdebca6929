"""Promises of the formations by name: every vehicle has a place, and none is nearer than requested."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.formation.shapes import SHAPES, ShapeName, formation_links


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
