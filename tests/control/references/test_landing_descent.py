"""Promises of the reference of a landing: straight down, within limits, slow at the floor, and it ends."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rcopterx.control.references.set_points import (
    DEPTH_M,
    DESCENT_ACCELERATION_M_S2,
    DESCENT_SPEED_M_S,
    FLARE_M,
    TOUCHDOWN_SPEED_M_S,
    descent,
)

PERIOD_S = 0.01
FLOORS_M = st.floats(-0.5, 1.0)
HEIGHTS_M = st.floats(0.0, 6.0)


@given(HEIGHTS_M, FLOORS_M)
@example(FLARE_M + 0.01, 0.0)
@example(FLARE_M + 0.1, 0.0)
def test_it_descends_straight_within_its_speed_and_acceleration_to_below_the_floor(
    height_m: float, floor_m: float
) -> None:
    start_m = np.array([0.4, -0.3, floor_m + height_m])
    reference = descent(start_m, floor_m, 0.2, 3.0)
    assert reference.finished(3.0 + 30.0)
    path = reference.sample(3.0, PERIOD_S, 3000)
    assert path.position_m[0] == pytest.approx(start_m)
    assert path.position_m[:, :2] == pytest.approx(np.tile(start_m[:2], (3000, 1)))
    assert path.yaw_rad == pytest.approx(0.2)
    assert (np.diff(path.position_m[:, 2]) < 1e-9).all()
    assert path.position_m[-1, 2] == pytest.approx(floor_m - DEPTH_M)
    assert path.velocity_m_s[:, 2].min() > -1.1 * DESCENT_SPEED_M_S
    assert np.abs(path.samples[:, 10]).max() < 1.1 * DESCENT_ACCELERATION_M_S2


@given(HEIGHTS_M, FLOORS_M)
def test_it_passes_the_floor_slowly(height_m: float, floor_m: float) -> None:
    path = descent(np.array([0.0, 0.0, floor_m + height_m]), floor_m, 0.0, 0.0).sample(0.0, PERIOD_S, 3000)
    low = path.position_m[:, 2] < floor_m + 0.9 * FLARE_M
    assert path.velocity_m_s[low, 2].min() > -1.1 * TOUCHDOWN_SPEED_M_S


@pytest.mark.parametrize(("height_m", "limit_s"), [(0.3, 4.0), (1.0, 4.0), (2.0, 7.0), (4.5, 14.0)])
def test_a_landing_reaches_the_floor_well_before_programs_give_up(height_m: float, limit_s: float) -> None:
    path = descent(np.array([0.0, 0.0, height_m]), 0.0, 0.0, 0.0).sample(0.0, PERIOD_S, 3000)
    assert PERIOD_S * np.searchsorted(-path.position_m[:, 2], 0.0) < limit_s
