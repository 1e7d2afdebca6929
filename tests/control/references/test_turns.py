"""Whole turns of headings."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.control.references.columns import COLUMNS
from rcopterx.control.references.trajectory import Trajectory, nearest_heading, on_turn_of

headings = st.floats(-100.0, 100.0)


@given(headings, headings)
def test_the_nearest_heading_is_the_same_and_at_most_half_a_turn_away(yaw: float, near: float) -> None:
    found = nearest_heading(yaw, near)
    assert abs(found - near) <= math.pi + 1e-9
    assert abs(math.remainder(found - yaw, math.tau)) < 1e-9


@given(headings, headings)
def test_a_trajectory_keeps_its_shape_when_it_changes_turns(yaw: float, near: float) -> None:
    samples = np.zeros((5, COLUMNS))
    samples[:, 3] = yaw + np.arange(5.0)
    moved = on_turn_of(Trajectory(samples, 0.02), near)
    assert abs(moved.yaw_rad[0] - near) <= math.pi + 1e-9
    assert np.allclose(np.diff(moved.yaw_rad), 1.0)
    assert not moved.samples[:, :3].any()
