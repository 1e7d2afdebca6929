"""Promises of the calm part of a frame's period."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus.calm import BUSY_SHARE, LONGEST_PERIOD_S, calm_at_s

TIMES = st.floats(0.0, 1e5)


@given(due_s=TIMES, arrived_s=TIMES, period_s=st.floats(0.002, LONGEST_PERIOD_S))
def test_what_can_wait_is_done_in_the_second_half_of_a_period_at_most_half_of_it_later(
    due_s: float, arrived_s: float, period_s: float
) -> None:
    at_s = calm_at_s(due_s, arrived_s, period_s)
    assert due_s <= at_s <= due_s + BUSY_SHARE * period_s
    into_s = (at_s - arrived_s) % period_s
    tolerance_s = 1e-9
    # A moment at the very end of the second half rounds into the next period.
    assert into_s >= BUSY_SHARE * period_s - tolerance_s or at_s == due_s


@given(due_s=TIMES, arrived_s=TIMES, period_s=st.floats(0.002, LONGEST_PERIOD_S))
def test_what_is_due_in_the_second_half_is_done_at_once(
    due_s: float, arrived_s: float, period_s: float
) -> None:
    into_s = (due_s - arrived_s) % period_s
    assert (calm_at_s(due_s, arrived_s, period_s) == due_s) == (into_s >= BUSY_SHARE * period_s)


@pytest.mark.parametrize(
    ("due_s", "arrived_s", "period_s"),
    [
        (5.0, None, 0.0),
        (5.0, 5.0, 0.0),
        (5.0, 5.0, 2 * LONGEST_PERIOD_S),
        (5.0, 5.0, math.nan),
        (-math.inf, 5.0, 0.02),
    ],
)
def test_without_a_steady_motion_capture_or_in_a_hurry_nothing_waits(
    due_s: float, arrived_s: float | None, period_s: float
) -> None:
    assert calm_at_s(due_s, arrived_s, period_s) == due_s
