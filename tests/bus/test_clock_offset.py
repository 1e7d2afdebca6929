"""Promises of the offset between clocks: exact for equal ways, within half the round trip for any."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus.host_messages import Beat, Echo, LinkState
from rcopterx.bus.link_watch import SAMPLES, LinkWatch

HELD_S = 0.03
ways_s = st.floats(0.0, 0.5)
offsets_s = st.floats(-1e5, 1e5)


def exchange(watch: LinkWatch, at_s: float, offset_s: float, there_s: float, back_s: float) -> None:
    answered_s = at_s + there_s + HELD_S
    echo = Echo(router="a0", sent_s=at_s, held_s=HELD_S)
    beat = Beat(router="b0", sent_s=answered_s + offset_s, time_of_day_s=0.0, echoes={"a": echo})
    watch.add_beat("b", beat, answered_s + back_s)


def measured(watch: LinkWatch) -> tuple[float, float]:
    """Offset and round trip."""
    state = state_of(watch)
    assert state.monotonic_offset_s is not None
    assert state.round_trip_s is not None
    return state.monotonic_offset_s, state.round_trip_s


def state_of(watch: LinkWatch) -> LinkState:
    return watch.states(["b"], 0.0, 0.0)["b"]


def test_nothing_is_known_before_the_first_exchange() -> None:
    watch = LinkWatch("a", "a0", 0.0)
    watch.add_beat("b", Beat(router="b0", sent_s=1.0, time_of_day_s=0.0, echoes={}), 1.0)
    assert (state_of(watch).monotonic_offset_s, state_of(watch).round_trip_s) == (None, None)


@given(offsets_s, st.lists(st.tuples(ways_s, ways_s), min_size=1, max_size=30))
def test_the_offset_is_wrong_by_at_most_half_the_shortest_round_trip(
    offset_s: float, ways: list[tuple[float, float]]
) -> None:
    watch = LinkWatch("a", "a0", 0.0)
    for number, (there_s, back_s) in enumerate(ways):
        exchange(watch, 0.05 * number, offset_s, there_s, back_s)
    found_s, round_trip_s = measured(watch)
    shortest_s = min(there_s + back_s for there_s, back_s in ways)
    assert round_trip_s == pytest.approx(shortest_s, abs=1e-6)
    assert abs(found_s - offset_s) <= shortest_s / 2 + 1e-6


@given(offsets_s, ways_s)
def test_equal_ways_give_the_exact_offset(offset_s: float, way_s: float) -> None:
    watch = LinkWatch("a", "a0", 0.0)
    exchange(watch, 5.0, offset_s, way_s, way_s)
    assert measured(watch)[0] == pytest.approx(offset_s, abs=1e-6)


def test_a_clock_that_was_set_is_followed_when_old_exchanges_are_forgotten() -> None:
    watch = LinkWatch("a", "a0", 0.0)
    exchange(watch, 0.0, 3.0, 0.0001, 0.0001)
    for number in range(SAMPLES):
        exchange(watch, 1.0 + number, 8.0, 0.001, 0.001)
    assert measured(watch)[0] == pytest.approx(8.0)
