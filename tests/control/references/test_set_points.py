"""Promises of smooth turns: within their limits, from where the heading is, to its end."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.control.references.set_points import SetPointReference, Transition, TurnLimits, smooth_turn
from rcopterx.control.references.trajectory import COLUMNS

PERIOD_S = 0.01
PLACE = np.array([0.3, -0.2, 1.0])
headings = st.floats(-10.0, 10.0)
limits = st.builds(TurnLimits, st.floats(0.3, 3.0), st.floats(0.3, 6.0))


def flown(turn: Transition, from_s: float = 0.0) -> np.ndarray:
    return turn.sample(from_s, PERIOD_S, 15000).samples


@given(headings, headings, limits)
def test_a_turn_from_rest_keeps_its_limits_and_ends_at_its_heading(
    start: float, end: float, limit: TurnLimits
) -> None:
    present = SetPointReference(PLACE + 1.0, start).sample(0.0, 1.0, 1).samples[0]
    rows = flown(smooth_turn(limit, PLACE, end, present, 0.0))
    assert np.abs(rows[:, :3] - PLACE).max() < 1e-6
    assert rows[0, 3::4] == pytest.approx([start, 0.0, 0.0])
    assert rows[-1, 3::4] == pytest.approx([end, 0.0, 0.0])
    assert limit.used(rows).max() <= 1.02
    assert np.abs(np.gradient(rows[:, 3], PERIOD_S) - rows[:, 7])[1:-1].max() < 0.01


@given(headings, headings, limits, st.floats(0.0, 1.0))
def test_a_new_heading_on_the_way_is_taken_up_without_a_step(
    first: float, second: float, limit: TurnLimits, share: float
) -> None:
    present = np.zeros(COLUMNS)
    before = smooth_turn(limit, PLACE, first, present, 0.0)
    at_s = share * before.path.duration_s
    there = before.sample(at_s, PERIOD_S, 1).samples[0]
    after = smooth_turn(limit, PLACE, second, there, at_s)
    rows = flown(after, at_s)
    assert rows[0, 3::4] == pytest.approx(there[3::4])
    assert rows[-1, 3] == pytest.approx(second)
    assert limit.used(rows).max() <= 1.02


def test_a_turn_takes_no_longer_than_its_limits_ask_for() -> None:
    present = np.zeros(COLUMNS)
    turn = smooth_turn(TurnLimits(1.0, 100.0), PLACE, np.pi, present, 5.0)
    shortest_s = 1.875 * np.pi
    assert shortest_s <= turn.path.duration_s <= 1.1 * shortest_s
    assert not turn.finished(5.0 + 0.9 * shortest_s)
    assert turn.finished(5.0 + 1.1 * shortest_s)
