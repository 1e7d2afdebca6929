"""Promises of the offset between clocks: exact for equal ways, within half the round trip for any."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus.link_watch import SAMPLES, ClockFilter

ways_s = st.floats(0.0, 0.5)
offsets_s = st.floats(-1e5, 1e5)


def exchange(clocks: ClockFilter, at_s: float, offset_s: float, there_s: float, back_s: float) -> None:
    received_s = at_s + there_s + offset_s
    answered_s = received_s + 0.03
    clocks.add(at_s, received_s, answered_s, answered_s - offset_s + back_s)


def test_nothing_is_known_before_the_first_exchange() -> None:
    assert ClockFilter().best() is None


@given(offsets_s, st.lists(st.tuples(ways_s, ways_s), min_size=1, max_size=30))
def test_the_offset_is_wrong_by_at_most_half_the_shortest_round_trip(
    offset_s: float, ways: list[tuple[float, float]]
) -> None:
    clocks = ClockFilter()
    for number, (there_s, back_s) in enumerate(ways):
        exchange(clocks, 0.05 * number, offset_s, there_s, back_s)
    best = clocks.best()
    assert best is not None
    shortest_s = min(there_s + back_s for there_s, back_s in ways)
    assert best.round_trip_s == pytest.approx(shortest_s, abs=1e-6)
    assert abs(best.offset_s - offset_s) <= shortest_s / 2 + 1e-6


@given(offsets_s, ways_s)
def test_equal_ways_give_the_exact_offset(offset_s: float, way_s: float) -> None:
    clocks = ClockFilter()
    exchange(clocks, 5.0, offset_s, way_s, way_s)
    best = clocks.best()
    assert best is not None
    assert best.offset_s == pytest.approx(offset_s, abs=1e-6)


def test_a_clock_that_was_set_is_followed_when_old_exchanges_are_forgotten() -> None:
    clocks = ClockFilter()
    exchange(clocks, 0.0, 3.0, 0.0001, 0.0001)
    for number in range(SAMPLES):
        exchange(clocks, 1.0 + number, 8.0, 0.001, 0.001)
    best = clocks.best()
    assert best is not None
    assert best.offset_s == pytest.approx(8.0)
