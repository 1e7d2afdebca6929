"""Reading a trajectory at other instants."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.agents.references.trajectory import COLUMNS, POSITION, VELOCITY, Trajectory

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
    assert read.acceleration_m_s2[:, 0] == pytest.approx(-2.0)


def test_long_before_the_first_stage_and_beyond_the_last_it_keeps_its_velocity() -> None:
    plan = moving()
    read = plan.resampled(-0.1, PERIOD_S, 40)
    last = plan.samples[-1]
    assert read.samples[0, POSITION] == pytest.approx([-0.1, 0.0, 0.0])
    assert read.samples[0, VELOCITY] == pytest.approx([1.0, 0.0, 0.0])
    assert read.samples[-1, VELOCITY] == pytest.approx(last[VELOCITY])
    assert read.samples[-1, 0] == pytest.approx(last[0] + (40 - 5 - 20) * PERIOD_S * last[4])
    assert not read.acceleration_m_s2[[0, -1]].any()


@given(st.floats(-0.05, 0.5))
def test_positions_alone_are_the_same(start_s: float) -> None:
    plan = moving()
    whole = plan.resampled(start_s, PERIOD_S, 10).position_m
    assert plan.positions_from(start_s, PERIOD_S, 10) == pytest.approx(whole, abs=1e-12)
