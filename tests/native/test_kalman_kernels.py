"""Promises of the kernels of the Kalman filters: textbook equations with whole matrices."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.native.kalman import correct_lags, correct_tilt, lag_jacobian, predict_lags, predict_tilt
from rcopterx.native.motion import PARAMETERS, predict_motion
from rcopterx.vehicles.state import heading_matrix

SIZE = 12
TILTED = 4
SERVO = 8


def positive(rng: np.random.Generator, size: int) -> np.ndarray:
    root = rng.normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


@given(st.integers(0, 10_000))
def test_a_prediction_is_that_of_a_linear_system(seed: int) -> None:
    rng = np.random.default_rng(seed)
    state, covariance, process = rng.normal(size=SIZE), positive(rng, SIZE), positive(rng, SIZE)
    size, pole = SIZE - 4, 0.4
    transition, demand = rng.normal(size=(size, size)), rng.normal(size=(size, 2))
    moving = size - 4
    transition[moving:, :] = 0.0
    transition[moving : moving + 2, moving : moving + 2] = pole * np.eye(2)
    transition[moving + 2 :, moving + 2 :] = 0.9 * np.eye(2)
    gain, yaw_rad, stick = rng.normal(size=2), rng.normal(), rng.normal(size=2)
    turned = heading_matrix(yaw_rad) * gain
    whole, inputs = np.eye(SIZE), np.zeros((SIZE, 2))
    whole[:size, :size] = transition
    whole[:moving, moving : moving + 2] = transition[:moving, moving : moving + 2] @ turned
    whole[:moving, size : size + 2] = inputs[:moving] = demand[:moving] @ turned
    whole[moving : moving + 2, size : size + 2] = inputs[moving : moving + 2] = (1.0 - pole) * np.eye(2)
    found, spread = state.copy(), covariance.copy()
    predict_tilt(found, spread, transition, demand, process, gain, yaw_rad, stick, pole, moving)
    assert found == pytest.approx(whole @ state + inputs @ stick)
    assert spread == pytest.approx(whole @ covariance @ whole.T + process)


@given(st.integers(0, 10_000), st.booleans(), st.floats(-4.0, 4.0))
def test_a_correction_is_the_best_linear_estimate(seed: int, measured: bool, yaw_rad: float) -> None:
    rng = np.random.default_rng(seed)
    state, covariance = rng.normal(size=SIZE), positive(rng, SIZE)
    position, tilt, variances = rng.normal(size=2), rng.normal(size=2), rng.uniform(0.1, 1.0, size=4)
    observed = np.zeros((4, SIZE))
    observed[:2, :2] = observed[2:, TILTED : TILTED + 2] = np.eye(2)
    observed[2:, -2:] = heading_matrix(yaw_rad)
    count = 4 if measured else 2
    observed, seen = observed[:count], np.concatenate((position, tilt))[:count]
    innovation = observed @ covariance @ observed.T + np.diag(variances[:count])
    gain = covariance @ observed.T @ np.linalg.inv(innovation)
    found, left = state.copy(), covariance.copy()
    taken_in, definite = correct_tilt(
        found, left, position, tilt, measured, TILTED, yaw_rad, variances, np.full(SIZE, np.inf), 1e3
    )
    assert (taken_in, definite) == (measured, True)
    assert found == pytest.approx(state + gain @ (seen - observed @ state))
    assert left == pytest.approx((np.eye(SIZE) - gain @ observed) @ covariance, abs=1e-9)


def test_a_tilt_beyond_its_gate_is_left_out_and_states_stay_within_their_limits() -> None:
    state, limit = np.zeros(SIZE), np.full(SIZE, 0.5)
    arguments = (state, np.eye(SIZE), np.array([2.0, 0.0]), np.array([0.0, 0.4]), True, TILTED, 0.0)
    taken_in, _ = correct_tilt(*arguments, np.full(4, 1e-3), limit, 0.3)
    assert not taken_in
    assert state[0] == 0.5
    assert state[TILTED + 1] == 0.0


def test_a_covariance_that_is_none_is_told_and_changes_nothing() -> None:
    state, covariance = np.zeros(SIZE), -np.eye(SIZE)
    _, definite = correct_tilt(
        state, covariance, np.ones(2), np.zeros(2), False, TILTED, 0.0, np.full(4, 1e-3), np.ones(SIZE), 1.0
    )
    assert not definite
    assert not state.any()
    assert (covariance == -np.eye(SIZE)).all()


@given(st.integers(0, 10_000))
def test_a_period_of_the_filter_on_lags_is_a_prediction_and_its_linearization(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle, motion = rng.uniform(0.1, 1.0, size=PARAMETERS), rng.normal(size=8)
    actuator, sticks, disturbance = rng.normal(size=(3, 4))
    constant, covariance, process = rng.normal(size=(16, 16)), positive(rng, 16), positive(rng, 16)
    given_ = vehicle, motion, actuator, sticks, disturbance, 0.01, 2
    moved, held, spread = np.empty(8), np.empty(4), covariance.copy()
    predict_lags(*given_, constant, spread, process, moved, held)
    expected = np.empty(8), np.empty(4)
    predict_motion(*given_, *expected)
    jacobian = lag_jacobian(constant, motion, moved)
    assert np.array_equal(moved, expected[0])
    assert np.array_equal(held, expected[1])
    assert spread == pytest.approx(jacobian @ covariance @ jacobian.T + process)


@given(st.integers(0, 10_000))
def test_a_pose_corrects_the_filter_on_lags_as_the_best_linear_estimate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    covariance, innovation, variance = positive(rng, 16), rng.normal(size=4), rng.uniform(0.1, 1.0, size=4)
    state, limit = rng.normal(size=16), rng.uniform(0.1, 1.0, size=4)
    gain = covariance[:, :4] @ np.linalg.inv(covariance[:4, :4] + np.diag(variance))
    expected = state + gain @ innovation
    left = covariance - gain @ covariance[:4]
    motion, actuator, disturbance = state[:8].copy(), state[8:12].copy(), state[12:].copy()
    assert correct_lags(covariance, innovation, variance, motion, actuator, disturbance, limit)
    assert np.concatenate((motion, actuator)) == pytest.approx(expected[:12])
    assert disturbance == pytest.approx(np.clip(expected[12:], -limit, limit))
    assert covariance == pytest.approx(left, abs=1e-9)


def test_a_covariance_on_lags_that_is_none_is_told_and_changes_nothing() -> None:
    covariance, motion = -np.eye(16), np.zeros(8)
    rest = np.zeros(4), np.zeros(4), np.ones(4)
    assert not correct_lags(covariance, np.ones(4), np.full(4, 1e-3), motion, *rest)
    assert not motion.any()
    assert (covariance == -np.eye(16)).all()
