"""Reading a trajectory at other instants."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rcopterx.control.references.columns import COLUMNS, POSITION, VELOCITY
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.state import Array

PERIOD_S = 0.02


def moving(stages: int = 20) -> Trajectory:
    """A vehicle that moves along x with 1 m/s and brakes with 2 m/s^2."""
    samples, time_s = np.zeros((stages, COLUMNS)), PERIOD_S * np.arange(stages)
    samples[:, 0], samples[:, 4], samples[:, 8] = time_s - time_s**2, 1.0 - 2.0 * time_s, -2.0
    return Trajectory(samples, PERIOD_S)


@given(st.floats(0.0, 0.999))
def test_a_little_before_the_first_stage_it_moves_as_at_the_first(share: float) -> None:
    read = moving().resampled(-share * PERIOD_S, PERIOD_S, 5)
    assert read.position_m[0, 0] == pytest.approx(-share * PERIOD_S, abs=1e-7)
    assert read.velocity_m_s[:, 0] == pytest.approx(1.0 - 0.04 * np.arange(5), abs=0.0401)
    assert read.samples[:, 8] == pytest.approx(-2.0)


def test_long_before_the_first_stage_and_beyond_the_last_it_keeps_its_velocity() -> None:
    plan = moving()
    read = plan.resampled(-0.1, PERIOD_S, 40)
    last = plan.samples[-1]
    assert read.samples[0, POSITION] == pytest.approx([-0.1, 0.0, 0.0])
    assert read.samples[0, VELOCITY] == pytest.approx([1.0, 0.0, 0.0])
    assert read.samples[-1, VELOCITY] == pytest.approx(last[VELOCITY])
    assert read.samples[-1, 0] == pytest.approx(last[0] + (40 - 5 - 20) * PERIOD_S * last[4])
    assert not read.samples[[0, -1], 8:11].any()


def read_by_numpy(plan: Trajectory, start_s: float, period_s: float, stages: int) -> Array:
    """Linear between stages; outside, the first or last velocity, unaccelerated from a period off."""
    at = (start_s + period_s * np.arange(stages)) / plan.period_s
    nearest = np.round(at)
    at = np.where(np.abs(at - nearest) < 1e-6, nearest, at)
    last = len(plan.samples) - 1
    columns = [np.interp(at, np.arange(len(plan.samples)), column) for column in plan.samples.T]
    samples: Array = np.column_stack(columns)
    beyond_s = np.maximum(at - last, 0.0)[:, None] * plan.period_s
    before_s = np.minimum(at, 0.0)[:, None] * plan.period_s
    samples[:, :4] += beyond_s * plan.samples[-1, 4:8] + before_s * plan.samples[0, 4:8]
    samples[(at > last) | (at <= -1), 8:] = 0.0
    return samples


@settings(deadline=None)
@given(
    arrays(np.float64, st.tuples(st.integers(1, 8), st.just(COLUMNS)), elements=st.floats(-10, 10)),
    st.integers(-3, 10).map(lambda stage: stage * PERIOD_S) | st.floats(-0.1, 0.4),
    st.sampled_from([PERIOD_S, 0.5 * PERIOD_S, 0.03]),
    arrays(np.float64, 4, elements=st.floats(-3, 3)),
)
def test_what_is_read_is_what_stands_between_the_stages_and_its_offset(
    samples: Array, start_s: float, period_s: float, offset: Array
) -> None:
    plan = Trajectory(samples, PERIOD_S)
    read = plan.resampled(start_s, period_s, 12)
    assert read.samples == pytest.approx(read_by_numpy(plan, start_s, period_s, 12), abs=1e-9)
    moved = plan.displaced(start_s, period_s, 12, offset[:3], float(offset[3]))
    read.samples[:, :4] += offset
    assert np.array_equal(moved.samples, read.samples)


@given(st.integers(0, 12))
def test_on_its_stages_a_plan_is_read_bit_for_bit(first: int) -> None:
    plan = moving()
    read = plan.resampled(first * PERIOD_S, PERIOD_S, len(plan.samples) - first)
    assert np.array_equal(read.samples, plan.samples[first:])
