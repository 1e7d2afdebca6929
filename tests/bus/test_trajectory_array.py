"""Promises of packed trajectories: what is sent arrives, rounded once, and plans take few bytes."""

import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from rcopterx.bus.message import InvalidMessageError
from rcopterx.bus.messages import PLAN_COLUMNS
from rcopterx.bus.trajectory_array import TrajectoryArray

LARGEST = TrajectoryArray.LARGEST
PERIOD_S = 0.02
UNIT = TrajectoryArray.rate_units(PERIOD_S)[0]

periods = st.floats(1e-3, 1.0)
trajectories = st.integers(2, 30).flatmap(
    lambda stages: arrays(np.float64, (stages, PLAN_COLUMNS), elements=st.floats(-1e3, 1e3))
)


def planned(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Trajectory through positions, shape (N + 2, 4), whose rates and accelerations are their differences."""
    rates = np.diff(positions, axis=0) / PERIOD_S
    accelerations = np.diff(rates, axis=0) / PERIOD_S
    return np.hstack((positions[:-2], rates[:-1], accelerations))


@settings(deadline=None)
@given(trajectories, periods)
def test_trajectories_arrive_within_a_unit_and_a_half(values: NDArray[np.float64], period_s: float) -> None:
    packed = TrajectoryArray.of(values, period_s)
    packed.check("x", max_stages=30, min_stages=2)
    rates, accelerations = TrajectoryArray.rate_units(period_s), TrajectoryArray.ACCELERATION_UNITS
    units = np.hstack((np.full(4, 1.5e-4), np.multiply(0.5, rates), np.multiply(1.5, accelerations)))
    assert np.all(np.abs(packed.to_numpy(period_s) - values) <= units + 1e-9)


@settings(deadline=None)
@given(trajectories, periods)
def test_a_trajectory_that_was_rounded_once_travels_unchanged(
    values: NDArray[np.float64], period_s: float
) -> None:
    once = TrajectoryArray.of(values, period_s)
    assert TrajectoryArray.of(once.to_numpy(period_s), period_s) == once


@settings(deadline=None)
@given(st.floats(LARGEST, 1e300), st.integers(0, PLAN_COLUMNS - 1))
def test_values_beyond_the_largest_are_cut_off_when_a_trajectory_is_packed(value: float, column: int) -> None:
    values = np.zeros((2, PLAN_COLUMNS))
    values[:, column] = -value, value
    packed = TrajectoryArray.of(values, PERIOD_S)
    packed.check("x", max_stages=2, min_stages=2)
    assert packed.to_numpy(PERIOD_S)[:, column] == pytest.approx([-LARGEST, LARGEST])


def test_what_follows_from_the_rates_is_not_sent() -> None:
    time_s = PERIOD_S * np.arange(52)
    smooth = np.column_stack((np.sin(time_s), np.cos(2.0 * time_s), 1.0 + 0.1 * time_s, 0.5 * time_s**2))
    samples = planned(smooth)
    packed = TrajectoryArray.of(samples, PERIOD_S)
    blocks = np.frombuffer(packed.data, dtype=np.uint8).reshape(-1, 3, 50, 4)
    assert not blocks[:, 1, 1:].any()
    assert not blocks[:, 2, :-1].any()
    assert len(zlib.compress(packed.data)) < 200
    assert packed.to_numpy(PERIOD_S)[:, :4] == pytest.approx(samples[:, :4], abs=1.5e-4)


def test_trajectories_travel_as_folded_differences_of_their_rates() -> None:
    values = np.zeros((3, PLAN_COLUMNS))
    values[:, 0] = 1.0, 1.0, 1.0
    values[:, 4] = 0.0, 300 * UNIT, 300 * UNIT
    values[:, 8] = 300 * UNIT / PERIOD_S, 0.0, 0.0
    values[2, 0] = 1.0 + 300 * UNIT * PERIOD_S
    packed = TrajectoryArray.of(values, PERIOD_S)
    rate = [0, 0, 0, 0, 600, 0, 0, 0, 599, 0, 0, 0]
    words = [*rate, 20_000, *23 * [0]]
    assert packed.data == bytes(word & 255 for word in words) + bytes(word >> 8 for word in words)
    assert TrajectoryArray.of(np.asfortranarray(values), PERIOD_S) == packed


@pytest.mark.parametrize(
    ("shape", "size", "told"),
    [
        ((1, 12), 12, "shape"), ((201, 12), 201 * 12, "shape"), ((2, 11), 22, "shape"),
        ((2, 12), 23, "needs 1 to 4 times 24"), ((2, 12), 0, "needs"), ((2, 12), 120, "needs"),
        ((2**40, 12), 12, "shape"), ((-2, 12), 24, "shape"),
    ],
)  # fmt: skip
def test_trajectories_that_lie_about_their_shape_are_refused(
    shape: tuple[int, int], size: int, told: str
) -> None:
    with pytest.raises(InvalidMessageError, match=told):
        TrajectoryArray(shape, bytes(size)).check("trajectory", max_stages=200, min_stages=2)


@given(st.binary(min_size=96, max_size=96), st.floats(min_value=0.0, max_value=1.0, exclude_min=True))
def test_whatever_arrives_is_finite_and_bounded(data: bytes, period_s: float) -> None:
    packed = TrajectoryArray((2, PLAN_COLUMNS), data)
    packed.check("trajectory", max_stages=2, min_stages=2)
    assert np.abs(packed.to_numpy(period_s)).max() <= LARGEST


@settings(deadline=None)
@given(
    arrays(np.float64, (6, PLAN_COLUMNS), elements=st.floats(-1e300, 1e300)),
    st.floats(min_value=0.0, max_value=1.0, exclude_min=True),
)
def test_absurd_trajectories_travel_bounded(values: NDArray[np.float64], period_s: float) -> None:
    packed = TrajectoryArray.of(values, period_s)
    packed.check("trajectory", max_stages=6, min_stages=6)
    assert np.abs(packed.to_numpy(period_s)).max() <= LARGEST
