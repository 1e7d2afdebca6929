"""Promises of rounded numbers: near, with few bits, and a clock that never runs ahead."""

import time

from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus.rounding import TIME_BITS, all_rounded, monotonic_s, rounded


@given(st.floats(-1e5, 1e5), st.integers(0, 24))
def test_rounded_numbers_are_near_and_whole_units(value: float, bits: int) -> None:
    near = rounded(value, bits)
    assert abs(near - value) <= 0.5 / 2.0**bits
    assert (near * 2.0**bits).is_integer()
    assert all_rounded((value, near), bits) == (near, near)


def test_the_clock_has_whole_ticks_and_is_never_ahead() -> None:
    before_s = time.monotonic()
    now_s = monotonic_s()
    assert before_s - 2.0**-TIME_BITS <= now_s <= time.monotonic()
    assert (now_s * 2.0**TIME_BITS).is_integer()
