"""Promises of rounded numbers: near, with few bits."""

from hypothesis import given
from hypothesis import strategies as st

from rcopterx.bus.rounding import all_rounded, rounded


@given(st.floats(-1e5, 1e5), st.integers(0, 24))
def test_rounded_numbers_are_near_and_whole_units(value: float, bits: int) -> None:
    near = rounded(value, bits)
    assert abs(near - value) <= 0.5 / 2.0**bits
    assert (near * 2.0**bits).is_integer()
    assert all_rounded((value, near), bits) == (near, near)
