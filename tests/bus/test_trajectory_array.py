"""Promises of packed trajectories: samples arrive within their resolution, and quiet ones take few bytes."""

import math
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from rcopterx.bus.message import MAX_MAGNITUDE, InvalidMessageError
from rcopterx.bus.trajectory_array import MAX_COUNT, PLAN_COLUMNS, TrajectoryArray, Twelve

RESOLUTION = np.array(TrajectoryArray.RESOLUTION)
LARGEST = 0.3 * MAX_MAGNITUDE

stages = st.integers(2, 30)
slow = stages.flatmap(lambda rows: arrays(np.float64, (rows, PLAN_COLUMNS), elements=st.floats(-1.0, 1.0)))
fast = stages.flatmap(
    lambda rows: arrays(np.float64, (rows, PLAN_COLUMNS), elements=st.floats(-LARGEST, LARGEST))
)


def twelve(value: float) -> Twelve:
    return (value,) * PLAN_COLUMNS  # type: ignore[return-value]


def checked(packed: TrajectoryArray) -> TrajectoryArray:
    packed.check("trajectory", max_stages=200, min_stages=2)
    return packed


@settings(deadline=None)
@given(slow)
def test_samples_arrive_within_half_the_resolution(values: NDArray[np.float64]) -> None:
    packed = checked(TrajectoryArray.of(values))
    assert packed.scale == TrajectoryArray.RESOLUTION
    assert np.all(np.abs(packed.to_numpy() - values) <= 0.5 * RESOLUTION + 1e-12)


@settings(deadline=None)
@given(slow)
def test_a_trajectory_that_was_rounded_once_travels_unchanged(values: NDArray[np.float64]) -> None:
    once = TrajectoryArray.of(values)
    assert TrajectoryArray.of(once.to_numpy()) == once


@settings(deadline=None)
@given(fast)
def test_nothing_is_cut_off_however_large_the_range_of_a_column(values: NDArray[np.float64]) -> None:
    packed = checked(TrajectoryArray.of(values))
    ranges = np.ptp(values, axis=0)
    assert np.all(np.abs(packed.to_numpy() - values) <= RESOLUTION + ranges / MAX_COUNT)


def test_a_quiet_trajectory_takes_few_bytes() -> None:
    values = np.tile(np.arange(PLAN_COLUMNS, dtype=float), (50, 1))
    packed = TrajectoryArray.of(values)
    assert not any(packed.data)
    assert len(zlib.compress(packed.data)) < 30
    assert np.array_equal(packed.to_numpy(), values)


def test_another_program_unpacks_a_trajectory_in_one_line() -> None:
    values = np.random.default_rng(0).normal(size=(50, PLAN_COLUMNS))
    for order in (values, np.asfortranarray(values)):
        packed = TrajectoryArray.of(order)
        data, scale, offset = packed.data, packed.scale, packed.offset
        assert np.array_equal(
            np.frombuffer(data, "<i2").reshape(12, -1).T * scale + offset, packed.to_numpy()
        )


@pytest.mark.parametrize("size", [0, 1, 24, 47, 49, 24 * 201, 2**20])
def test_data_of_another_length_is_refused(size: int) -> None:
    with pytest.raises(InvalidMessageError, match=r"trajectory: .* bytes"):
        checked(TrajectoryArray(twelve(0.0), twelve(1e-3), bytes(size)))


@pytest.mark.parametrize("column", [0, 11])
@pytest.mark.parametrize(
    ("offset", "scale", "reason"),
    [
        (0.0, 0.0, "scale"), (0.0, -1e-3, "scale"), (0.0, math.nan, "scale"), (0.0, math.inf, "up to"),
        (math.nan, 1e-3, "up to"), (-math.inf, 1e-3, "up to"), (0.0, 31.0, "up to"), (-1e6, 1e-3, "up to"),
    ],
)  # fmt: skip
def test_scales_and_offsets_of_absurd_samples_are_refused(
    column: int, offset: float, scale: float, reason: str
) -> None:
    offsets, scales = list(twelve(0.0)), list(twelve(1e-3))
    offsets[column], scales[column] = offset, scale
    with pytest.raises(InvalidMessageError, match=f"trajectory: .*{reason}"):
        checked(TrajectoryArray(tuple(offsets), tuple(scales), bytes(48)))  # type: ignore[arg-type]


@settings(deadline=None)
@given(
    st.binary(min_size=48, max_size=48),
    st.lists(st.floats(), min_size=12, max_size=12),
    st.lists(st.floats(), min_size=12, max_size=12),
)
def test_whatever_is_accepted_unpacks_to_bounded_samples(
    data: bytes, offset: list[float], scale: list[float]
) -> None:
    packed = TrajectoryArray(tuple(offset), tuple(scale), data)  # type: ignore[arg-type]
    try:
        checked(packed)
    except InvalidMessageError:
        return
    assert np.abs(packed.to_numpy()).max() <= MAX_MAGNITUDE * (1 + 1e-9)
