"""Promises of the kernels of a frame: what the kernels that they put together do one after the other."""

import math
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.control.estimators.noise_meter import NoiseMeter
from rcopterx.control.estimators.tilt_trust import TiltTrust
from rcopterx.native.flight import (
    AT_LIMIT,
    INDEFINITE_TILT,
    TILT_LEFT_OUT,
    TOLD,
    TRUST_CHANGED,
    UNREADABLE_TILT,
    correct_filters,
    expect_noise,
    predict_filters,
)
from rcopterx.native.kalman import (
    FAR,
    INDEFINITE,
    TAKEN_IN,
    correct_lags,
    correct_tilt,
    predict_lags,
    predict_tilt,
)
from rcopterx.native.motion import (
    LONGEST_STEP_S,
    MISSHAPEN,
    NOT_FINITE,
    PARAMETERS,
    SOUND,
    flaw,
    predict_estimate,
    predict_motion,
    predict_with_tilt,
)
from rcopterx.native.noise import BEYOND_S, NOISE, SEEN_S, judge_tilt
from rcopterx.vehicles.state import heading_matrix

SIZE = 12
TILTED = 4
PERIOD_S = 0.02
LEAST_M, LEAST_TILT = 1e-3, 4e-3


def positive(rng: np.random.Generator, size: int) -> np.ndarray:
    root = rng.normal(size=(size, size))
    return root @ root.T / size + 0.1 * np.eye(size)


class Filters:
    """Random filters, and a pose near what they expect."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.rng = rng
        self.state, self.covariance = 0.3 * rng.normal(size=16), positive(rng, 16)
        self.tilt_states = 0.1 * rng.normal(size=(2, SIZE))
        self.tilt_covariances = np.stack([positive(rng, SIZE) for _ in range(2)])
        self.believed = int(rng.integers(2))
        self.position_m = self.state[:3] + 0.1 * rng.normal(size=3)
        self.yaw_rad = float(self.state[3] + 0.1 * rng.normal())
        self.tilt = 0.1 * rng.normal(size=2)
        self.near, self.limit = np.full(4, 10.0), np.full(4, 1e3)
        self.noise, self.trust = NoiseMeter(4).memory, TiltTrust()
        self.variance, self.pose = np.full(4, 1e-3), np.full(4, np.nan)
        self.variances, self.gate = np.zeros(2), 1e3
        self.told = np.full(TOLD + SIZE, np.nan)

    def correct(self) -> int:
        return correct_filters(
            self.state, self.covariance, self.tilt_states, self.tilt_covariances, self.believed,
            self.position_m, self.yaw_rad, self.tilt, self.near, self.noise, PERIOD_S, np.full(4, 1e-9),
            self.variance, self.limit, self.pose, self.trust.memory, self.trust.noise_memory,
            np.array([LEAST_M, LEAST_TILT]), self.variances, TILTED, np.full(SIZE, np.inf), self.gate,
            self.told,
        )  # fmt: skip

    def correct_one_by_one(self) -> None:
        correct_lags(
            self.state, self.covariance, self.position_m, self.yaw_rad, self.tilt_states[self.believed],
            self.near, self.noise, PERIOD_S, np.full(4, 1e-9), self.variance, self.limit, self.pose,
        )  # fmt: skip
        measured, trust = len(self.tilt) > 0, self.trust
        yaw_rad = self.pose[3]
        if measured:
            expected = self.tilt_states[1, TILTED : TILTED + 2].copy()
            judge_tilt(trust.memory, trust.noise_memory, self.tilt, expected, yaw_rad, PERIOD_S)
        self.variances[:] = np.square(
            [max(np.sqrt(self.variance[0]), LEAST_M), max(trust.memory[NOISE], LEAST_TILT)]
        )
        correct_tilt(
            self.tilt_states, self.tilt_covariances, self.pose, self.tilt, measured, yaw_rad, *self.variances,
            TILTED, np.full(SIZE, np.inf), self.gate,
        )  # fmt: skip

    def numbers(self) -> list[np.ndarray]:
        return [
            self.state, self.covariance, self.tilt_states, self.tilt_covariances, self.variance,
            self.variances, self.pose, self.noise, self.trust.memory, self.trust.noise_memory,
        ]  # fmt: skip


@given(st.integers(0, 10_000), st.booleans())
def test_a_usual_pose_is_taken_in_as_by_one_kernel_after_the_other(seed: int, measured: bool) -> None:
    found = Filters(seed)
    if not measured:
        found.tilt = np.empty(0)
    expected = deepcopy(found)
    assert found.correct() == TAKEN_IN
    expected.correct_one_by_one()
    for one, other in zip(found.numbers(), expected.numbers(), strict=True):
        assert one == pytest.approx(other, rel=1e-12, abs=1e-12, nan_ok=True)
    known = found.tilt_states[found.believed]
    motion = found.state[:8].copy()
    motion[:2], motion[4:6] = known[:2], heading_matrix(found.state[3]).T @ known[2:4]
    assert found.told == pytest.approx(np.concatenate((motion, found.state[8:], known)), rel=1e-12)


@pytest.mark.parametrize(
    ("unusual", "outcome"),
    [
        ({"tilt": np.array([0.0, np.nan])}, UNREADABLE_TILT),
        ({"near": np.full(4, -1e3)}, FAR),
        ({"covariance": np.eye(16) + 2.0 * np.eye(16, k=1) + 2.0 * np.eye(16, k=-1)}, INDEFINITE),
    ],
)
def test_before_what_is_not_usual_nothing_changes(unusual: dict[str, Any], outcome: int) -> None:
    found = Filters(1)
    for name, value in unusual.items():
        setattr(found, name, value)
    states, tilts = found.state.copy(), found.tilt_states.copy()
    assert found.correct() == outcome
    assert (found.state == states).all()
    assert (found.tilt_states == tilts).all()


def test_an_upward_disturbance_at_its_limit_is_told_before_the_tilt_filters_change() -> None:
    found = Filters(2)
    found.limit = np.full(4, 1e-3)
    found.state[14] = 5.0
    tilts = found.tilt_states.copy()
    assert found.correct() == AT_LIMIT
    assert found.state[14] == 1e-3
    assert (found.tilt_states == tilts).all()


def test_a_change_of_trust_is_told_before_the_tilt_filters_change() -> None:
    found = Filters(3)
    memory = found.trust.memory
    memory[SEEN_S], memory[BEYOND_S] = 10.0, 10.0
    memory[4:8] = (0.1, 0.1, -0.1, 0.0)
    tilts = found.tilt_states.copy()
    assert found.correct() == TRUST_CHANGED
    assert not found.trust.trusted
    assert (found.tilt_states == tilts).all()


def test_a_tilt_beyond_its_gate_is_left_out_and_all_else_is_told() -> None:
    found = Filters(4)
    found.gate = 0.0
    assert found.correct() == TILT_LEFT_OUT
    assert np.isfinite(found.told).all()


def test_a_covariance_of_the_tilt_that_is_none_is_told() -> None:
    found = Filters(5)
    found.tilt_covariances[1] = -np.eye(SIZE)
    assert found.correct() == INDEFINITE_TILT


def test_noise_is_expected_as_measured_but_not_below_the_least() -> None:
    variances, trust = np.zeros(2), TiltTrust().memory
    expect_noise(np.full(4, 4e-6), trust, np.array([LEAST_M, LEAST_TILT]), variances)
    assert variances == pytest.approx([4e-6, LEAST_TILT**2])
    trust[NOISE] = 0.01
    expect_noise(np.full(4, 1e-9), trust, np.array([LEAST_M, LEAST_TILT]), variances)
    assert variances == pytest.approx([LEAST_M**2, 1e-4])


@given(st.integers(0, 10_000))
def test_a_period_moves_both_filters_on_with_the_heading_in_its_middle(seed: int) -> None:
    found = Filters(seed)
    expected, rng = deepcopy(found), found.rng
    lags = rng.uniform(0.1, 1.0, size=PARAMETERS), 0.01, 2, 0.3 * rng.normal(size=(16, 16)), positive(rng, 16)
    tilts = (
        0.3 * rng.normal(size=(8, 8)), 0.3 * rng.normal(size=(8, 2)), positive(rng, SIZE),
        rng.normal(size=4), 0.4, 4,
    )  # fmt: skip
    sticks = rng.normal(size=4)
    predict_filters(
        found.state, found.covariance, found.tilt_states, found.tilt_covariances, sticks, *lags, *tilts
    )
    middle_rad = predict_lags(expected.state, expected.covariance, sticks, *lags)
    predict_tilt(expected.tilt_states, expected.tilt_covariances, sticks, middle_rad, *tilts)
    for one, other in zip(found.numbers(), expected.numbers(), strict=True):
        assert one == pytest.approx(other, rel=1e-12, abs=1e-12, nan_ok=True)


@given(st.integers(0, 10_000), st.booleans(), st.floats(1e-3, 0.1))
def test_an_estimate_is_predicted_as_its_motion_and_its_tilt_are(
    seed: int, tilted: bool, period_s: float
) -> None:
    rng, cores = np.random.default_rng(seed), 4
    vehicle, motion, sticks = rng.uniform(0.1, 1.0, PARAMETERS), rng.normal(size=8), rng.normal(size=4)
    actuator, disturbance = rng.normal(size=(2, 4))
    tilt = [rng.normal(size=size) if tilted else np.empty(0) for size in (cores, 2, 2, 2)]
    transition, demand = rng.normal(size=(cores + 8, cores + 8)), rng.normal(size=(cores + 8, 2))
    after = np.empty(12 + (cores + 4) * tilted)
    known = motion, actuator, disturbance, *tilt, sticks, period_s, vehicle
    predict_estimate(*known, transition, demand, 0.4, after)
    steps = max(1, math.ceil(period_s / LONGEST_STEP_S))
    moved, held, changed = np.empty(8), np.empty(4), np.empty(cores + 4)
    predict_motion(vehicle, motion, actuator, sticks, disturbance, period_s / steps, steps, moved, held)
    if tilted:
        predict_with_tilt(motion, *tilt, sticks, vehicle, transition, demand, 0.4, moved, changed)
    expected = np.concatenate((moved, held, changed if tilted else np.empty(0)))
    assert after == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("tilted", [True, False])
def test_an_estimate_is_sound_unless_a_part_is_misshapen_or_not_finite(tilted: bool) -> None:
    parts = [np.zeros(size) for size in (8, 4, 4, *((6, 2, 2, 2) if tilted else (0, 0, 0, 0)))]
    assert flaw(*parts) == SOUND
    for place, part in enumerate(parts):
        if len(part):
            broken = part.copy()
            broken[-1] = np.inf
            assert flaw(*parts[:place], broken, *parts[place + 1 :]) == NOT_FINITE
        if place != 3:
            assert flaw(*parts[:place], np.zeros(len(part) + 1), *parts[place + 1 :]) == MISSHAPEN
