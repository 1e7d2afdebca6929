"""Promises of the kernels of noise meter and tilt trust: means of differences and of swings, in numpy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.native.noise import (
    COMMON,
    CONCORDANCE,
    DEVIATION_OF_MEAN,
    DISTRUSTED_AFTER_S,
    DISTRUSTED_BELOW,
    ENERGY,
    EXPECTED_ENERGY,
    LAST,
    LEAST_TILT,
    MEANS,
    NOISE,
    NOISE_ENERGY,
    OUTLIER,
    SEEN,
    SMALLEST_WINDOW,
    TRUST,
    TRUSTED,
    TRUSTED_ABOVE,
    TRUSTED_AFTER_S,
    WINDOW_S,
    judge_tilt,
    measure_noise,
    observe_noise,
)
from rcopterx.vehicles.state import heading_matrix

PERIOD_S = 0.02
GAP_S = 0.06


def noise_means(values: np.ndarray, periods_s: list[float]) -> tuple[int, np.ndarray]:
    """Third differences of regular poses seen, and the means of their sizes."""
    kept: list[np.ndarray] = []
    regular_s, seen, mean = 0.0, 0, np.zeros(values.shape[1])
    for value, period_s in zip(values, periods_s, strict=True):
        if abs(period_s - regular_s) > 0.2 * regular_s:
            kept, regular_s = [], period_s
        kept = [*kept, value][-LAST:]
        if len(kept) == LAST:
            seen += 1
            size = np.abs(np.array([-1.0, 3.0, -3.0, 1.0]) @ np.array(kept))
            if seen > SMALLEST_WINDOW:
                size = np.minimum(size, OUTLIER * mean)
            mean = mean + max(1.0 / seen, period_s / WINDOW_S) * (size - mean)
    return seen, mean


@given(st.integers(0, 10_000), st.integers(1, 4), st.sets(st.integers(0, 99), max_size=3))
def test_the_mean_third_difference_of_regular_poses_is_kept(seed: int, channels: int, gaps: set[int]) -> None:
    values = np.random.default_rng(seed).standard_t(2, size=(100, channels))
    periods_s = [GAP_S if step in gaps else PERIOD_S for step in range(100)]
    memory = np.zeros(MEANS + (1 + LAST) * channels)
    for value, period_s in zip(values, periods_s, strict=True):
        observe_noise(memory, value, period_s)
    seen, mean = noise_means(values, periods_s)
    assert memory[SEEN] == seen
    assert memory[MEANS : MEANS + channels] == pytest.approx(mean)


@given(st.integers(0, 10_000), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_variances_are_those_of_the_worst_position_and_of_the_heading(
    seed: int, least_m: float, least_rad: float
) -> None:
    poses = np.random.default_rng(seed).normal(size=(60, 4))
    memory, variance = np.zeros(MEANS + (1 + LAST) * 4), np.full(4, -1.0)
    least = np.array([least_m, least_m, least_m, least_rad])
    for step, pose in enumerate(poses):
        assert (variance[0] == -1.0) == (step < SMALLEST_WINDOW + LAST - 1)
        measure_noise(memory, pose, PERIOD_S, least, variance)
    *noise_m, noise_rad = DEVIATION_OF_MEAN * noise_means(poses, [PERIOD_S] * 60)[1]
    worst_m = max(*noise_m, least_m)
    assert np.sqrt(variance) == pytest.approx([worst_m] * 3 + [max(noise_rad, least_rad)])


def test_normal_noise_is_told_by_its_standard_deviation() -> None:
    values = np.random.default_rng(1).normal(size=(20_000, 1))
    differences = values[3:] - 3.0 * values[2:-1] + 3.0 * values[1:-2] - values[:-3]
    assert DEVIATION_OF_MEAN * np.abs(differences).mean() == pytest.approx(1.0, rel=0.02)


@given(st.integers(0, 10_000), st.floats(-1.0, 1.0), st.floats(-4.0, 4.0))
def test_tilts_are_compared_by_how_they_swing_seen_from_the_vehicle(
    seed: int, alike: float, yaw_rad: float
) -> None:
    rng = np.random.default_rng(seed)
    expected = 0.1 * rng.normal(size=(400, 2))
    measured = alike * expected + 0.02 * rng.normal(size=(400, 2)) + 0.05
    trust, noise = np.zeros(TRUST), np.zeros(MEANS + (1 + LAST) * 2)
    trust[TRUSTED], trusted, beyond_s, seen_s = 1.0, True, 0.0, 0.0
    share = PERIOD_S / WINDOW_S
    back = heading_matrix(yaw_rad).T
    mean = np.concatenate((back @ measured[0], back @ expected[0]))
    energies = np.zeros(4)
    for step in range(400):
        before = trusted
        changed = judge_tilt(trust, noise, measured[step], expected[step], yaw_rad, PERIOD_S)
        now = np.concatenate((back @ measured[step], back @ expected[step]))
        mean += share * (now - mean)
        (x, y), (expected_x, expected_y) = (now - mean)[:2], (now - mean)[2:]
        deviation = np.zeros(2)
        if noise[SEEN] >= SMALLEST_WINDOW:
            deviation = DEVIATION_OF_MEAN * noise[MEANS : MEANS + 2]
        assert trust[NOISE] == pytest.approx(deviation.max())
        common = x * expected_x + y * expected_y
        seen = np.array([x**2 + y**2, expected_x**2 + expected_y**2, common, deviation @ deviation])
        energies += share * (seen - energies)
        swing = max(energies[0] - energies[3], 0.0)
        concordance = math.nan
        seen_s += PERIOD_S
        if seen_s >= WINDOW_S and energies[1] >= LEAST_TILT**2:
            concordance = 2.0 * energies[2] / (swing + energies[1])
            if energies[2] > 0.0 and swing >= LEAST_TILT**2:
                concordance = max(concordance, min(energies[2] / swing, swing / energies[2]))
        if not math.isnan(concordance):
            against = concordance < DISTRUSTED_BELOW if trusted else concordance > TRUSTED_ABOVE
            beyond_s = beyond_s + PERIOD_S if against else 0.0
            if beyond_s >= (DISTRUSTED_AFTER_S if trusted else TRUSTED_AFTER_S):
                trusted, beyond_s = not trusted, 0.0
        assert trust[CONCORDANCE] == pytest.approx(concordance, nan_ok=True)
        assert bool(trust[TRUSTED]) == trusted
        assert changed == (trusted != before)
    kept = trust[[ENERGY, EXPECTED_ENERGY, COMMON, NOISE_ENERGY]]
    assert kept == pytest.approx(energies)
