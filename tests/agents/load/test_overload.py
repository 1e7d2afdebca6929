"""Promises of what is left out under load: in a fixed order, one at a time, and done again in calm."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.agents.load import (
    EASE_AFTER_S,
    LATE_PERIODS,
    LATE_SHARE,
    LONGEST_EASE_AFTER_S,
    WINDOW_S,
    Overload,
    Relief,
)

PERIOD_S = 0.02
LATE_S = 1.01 * LATE_PERIODS * PERIOD_S * 4
"""Late at quarter rate, too."""
WINDOW = round(WINDOW_S / PERIOD_S)

periods = st.lists(st.tuples(st.floats(0.0, 0.1), st.integers(0, 5)), max_size=600)


def after(overload: Overload, late_s: float, seconds: float) -> list[Relief]:
    """What is left out from period to period while all of them are equally late."""
    seen = []
    for _ in range(round(seconds / PERIOD_S)):
        overload.observe(late_s, missed=0)
        seen.append(overload.relief)
    return seen


def test_who_keeps_up_leaves_nothing_out() -> None:
    assert set(after(Overload(PERIOD_S), 0.5 * PERIOD_S, 60.0)) == {Relief.NONE}


def test_everything_is_left_out_in_the_written_order() -> None:
    seen = after(Overload(PERIOD_S), LATE_S, 3.0)
    assert list(dict.fromkeys(seen)) == list(Relief)


def test_what_is_left_out_is_done_again_in_calm() -> None:
    overload = Overload(PERIOD_S)
    after(overload, LATE_S, 3.0)
    seen = after(overload, 0.0, 5 * EASE_AFTER_S)
    assert list(dict.fromkeys(seen)) == list(reversed(Relief))


def test_missed_periods_count_like_late_ones() -> None:
    overload = Overload(PERIOD_S)
    changed = [overload.observe(0.0, missed=1) for _ in range(WINDOW)]
    assert any(changed)
    assert overload.relief >= Relief.REPORTS


def test_who_flies_one_period_in_six_leaves_everything_out_as_soon_as_who_is_late() -> None:
    """Not the number of late commands counts, but for how long they have been late."""
    overload = Overload(PERIOD_S)
    for _ in range(round(2.0 / (6 * PERIOD_S))):
        overload.observe(LATE_S, missed=5)
    assert overload.relief is Relief.QUARTER_RATE


def test_a_few_late_periods_are_no_overload() -> None:
    overload = Overload(PERIOD_S)
    every = round(1 / LATE_SHARE) + 1
    for number in range(3000):
        assert not overload.observe(LATE_S if number % every == 0 else 0.0, missed=0)


def test_what_had_to_be_left_out_again_at_once_waits_longer_and_longer_but_not_for_ever() -> None:
    overload = Overload(PERIOD_S)
    waits = []
    for _ in range(8):
        while overload.relief is Relief.NONE:
            overload.observe(LATE_S, missed=0)
        calm = 0
        while overload.relief is not Relief.NONE:
            overload.observe(0.0, missed=0)
            calm += 1
        waits.append(calm * PERIOD_S)
    assert waits == pytest.approx([10.0, 20.0, 40.0, 80.0, 160.0, 160.0, 160.0, 160.0], abs=0.1)
    assert waits[-1] <= LONGEST_EASE_AFTER_S + PERIOD_S


def test_on_the_floor_everything_is_done_again() -> None:
    overload = Overload(PERIOD_S)
    after(overload, LATE_S, 3.0)
    assert overload.stand(0.0)
    assert overload.relief is Relief.NONE
    assert not overload.stand(0.0)


def test_a_vehicle_that_stands_notes_late_commands_and_leaves_nothing_out() -> None:
    overload = Overload(PERIOD_S)
    for _ in range(WINDOW):
        overload.stand(LATE_S)
    assert overload.late_share == 1.0
    assert overload.relief is Relief.NONE
    for _ in range(WINDOW):
        overload.stand(0.0)
    assert overload.late_share == 0.0


def test_every_level_is_reached_equally_fast() -> None:
    """A lower rate, at which fewer periods are observed, delays no decision."""
    overload, reached_s, now_s = Overload(PERIOD_S), dict[Relief, float](), 0.0
    while overload.relief is not Relief.QUARTER_RATE:
        now_s += PERIOD_S * overload.relief.every
        overload.observe(LATE_S, missed=0)
        reached_s.setdefault(overload.relief, now_s)
    assert list(reached_s) == list(Relief)
    steps_s = [later - earlier for earlier, later in pairwise(list(reached_s.values())[1:])]
    assert steps_s == pytest.approx([reached_s[Relief.REPORTS]] * 3, abs=4 * PERIOD_S)


@given(periods)
def test_relief_changes_by_one_step_and_says_so(course: list[tuple[float, int]]) -> None:
    overload = Overload(PERIOD_S)
    seen = [overload.relief]
    for late_s, missed in course:
        changed = overload.observe(late_s, missed)
        seen.append(overload.relief)
        assert changed == (seen[-1] is not seen[-2])
    assert all(abs(one - other) <= 1 for one, other in pairwise(seen))


@given(periods)
def test_after_whatever_it_was_calm_brings_everything_back(course: list[tuple[float, int]]) -> None:
    overload = Overload(PERIOD_S)
    for late_s, missed in course:
        overload.observe(late_s, missed)
    left_s = len(Relief) * (LONGEST_EASE_AFTER_S + WINDOW_S)
    while overload.relief is not Relief.NONE:
        left_s -= PERIOD_S
        assert left_s > 0.0
        overload.observe(0.0, missed=0)


def test_what_is_planned_stays_left_out_in_calm_and_on_the_floor() -> None:
    overload = Overload(PERIOD_S)
    overload.plan(Relief.HALF_RATE)
    assert set(after(overload, 0.0, 3 * EASE_AFTER_S)) == {Relief.HALF_RATE}
    assert not overload.stand(0.0)
    after(overload, LATE_S, 3.0)
    assert overload.relief is Relief.QUARTER_RATE
    calm = after(overload, 0.0, 5 * EASE_AFTER_S)
    assert list(dict.fromkeys(calm)) == [Relief.QUARTER_RATE, Relief.THIRD_RATE, Relief.HALF_RATE]
    overload.plan(Relief.NONE)
    assert overload.relief is Relief.NONE
