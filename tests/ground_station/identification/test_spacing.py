"""A formation is enlarged until its vehicles can be excited together, and stays in the flight volume."""

from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.ground_station.identification.identification import ABOVE_M, IdentificationError, spread
from rcopterx.vehicles.tuples import Three

ROOM = ((-3.0, -2.0, 0.0), (3.0, 2.0, 2.0))
REACH_M, DISTANCE_M = 0.25, 0.3
TRIO: dict[str, Three] = {"h1": (0.0, 0.0, 1.0), "h2": (-0.4, 0.5, 1.0), "h3": (-0.4, -0.5, 1.2)}
coordinates = st.floats(-1.5, 1.5)
places = st.lists(st.tuples(coordinates, coordinates, st.floats(0.5, 1.5)), min_size=1, max_size=5)


@given(places)
def test_vehicles_have_room_or_the_reason_is_shown(found: list[Three]) -> None:
    names = {f"h{index}": place for index, place in enumerate(found)}
    try:
        apart = spread(names, REACH_M, DISTANCE_M, ROOM)
    except IdentificationError as error:
        assert "above each other" in str(error) or "too small" in str(error)  # noqa: PT017 - either way
        return
    for (ax, ay, _), (bx, by, _) in combinations(apart.values(), 2):
        assert max(abs(ax - bx), abs(ay - by)) >= DISTANCE_M + 2 * REACH_M - 1e-9
    for place in apart.values():
        for value, low, high in zip(place, *ROOM, strict=True):
            assert low + REACH_M <= value <= high - REACH_M


def test_a_formation_keeps_its_shape() -> None:
    apart = spread(TRIO, REACH_M, DISTANCE_M, ROOM)
    factor = (DISTANCE_M + 2 * REACH_M) / 0.5
    (x, y, z), (lead_x, lead_y, _) = apart["h3"], apart["h1"]
    assert (x - lead_x, y - lead_y, z) == pytest.approx((-0.4 * factor, -0.5 * factor, 1.2))


def test_a_formation_with_room_stays_where_it_is() -> None:
    wide: dict[str, Three] = {"h1": (0.0, 0.0, 1.0), "h2": (1.0, 0.0, 1.0)}
    assert spread(wide, REACH_M, DISTANCE_M, ROOM) == wide


def test_vehicles_above_each_other_are_named() -> None:
    with pytest.raises(IdentificationError, match="h1 and h2 are above each other"):
        spread({"h1": (0.0, 0.0, 1.0), "h2": (0.5 * ABOVE_M, 0.0, 1.5)}, REACH_M, DISTANCE_M, ROOM)


def test_a_volume_that_is_too_small_is_an_error() -> None:
    with pytest.raises(IdentificationError, match=r"0\.\d\d m too small for 3 vehicles"):
        spread(TRIO, REACH_M, DISTANCE_M, ((-0.6, -0.6, 0.0), (0.6, 0.6, 2.0)))
