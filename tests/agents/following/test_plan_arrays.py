"""Promises of plans that kernels pack: they are those of `TrajectoryArray`, bit for bit."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from rcopterx.agents.following.plan_arrays import packed, samples_of
from rcopterx.bus.messages import PLAN_COLUMNS, Plan
from rcopterx.bus.trajectory_array import TrajectoryArray

periods = st.floats(1e-3, 1.0)
numbers = st.floats(-3.0, 3.0) | st.floats(-1e3, 1e3) | st.floats(-1e300, 1e300)
trajectories = st.integers(2, 30).flatmap(
    lambda stages: arrays(np.float64, (stages, PLAN_COLUMNS), elements=numbers)
)


@settings(deadline=None)
@given(trajectories, periods)
def test_packed_trajectories_are_those_of_the_format(values: NDArray[np.float64], period_s: float) -> None:
    assert packed(values, period_s) == TrajectoryArray.of(values, period_s)


@settings(deadline=None)
@given(st.integers(2, 20), st.integers(1, 4), st.integers(0, 2**32 - 1), periods)
def test_whatever_bytes_arrive_are_unpacked_as_the_format_says(
    stages: int, width: int, seed: int, period_s: float
) -> None:
    data = np.random.default_rng(seed).bytes(width * stages * PLAN_COLUMNS)
    trajectory = TrajectoryArray((stages, PLAN_COLUMNS), data)
    plan = Plan(
        epoch=1, frame=1, source="h1", ancestors=(), period_s=period_s, start_s=0.0, trajectory=trajectory
    )
    assert np.array_equal(samples_of(plan), plan.samples())
