"""Promises of the kernels of the Kalman filters: textbook equations with whole matrices."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rcopterx.control.estimators.noise_meter import NoiseMeter
from rcopterx.native.kalman import (
    FAR,
    INDEFINITE,
    TAKEN_IN,
    correct_lags,
    correct_tilt,
    lag_jacobian,
    predict_lags,
    predict_tilt,
)
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
    states, process = rng.normal(size=(2, SIZE)), positive(rng, SIZE)
    covariances = np.stack([positive(rng, SIZE) for _ in range(2)])
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
    found, spread = states.copy(), covariances.copy()
    predict_tilt(found, spread, stick, yaw_rad, transition, demand, process, gain, pole, moving)
    for number in range(2):
        assert found[number] == pytest.approx(whole @ states[number] + inputs @ stick)
        assert spread[number] == pytest.approx(whole @ covariances[number] @ whole.T + process)


@given(st.integers(0, 10_000), st.booleans(), st.floats(-4.0, 4.0))
def test_a_correction_is_the_best_linear_estimate_and_only_the_first_filter_sees_the_tilt(
    seed: int, measured: bool, yaw_rad: float
) -> None:
    rng = np.random.default_rng(seed)
    states, covariances = rng.normal(size=(2, SIZE)), np.stack([positive(rng, SIZE) for _ in range(2)])
    position, tilt, variances = rng.normal(size=2), rng.normal(size=2), rng.uniform(0.1, 1.0, size=2)
    found, left = states.copy(), covariances.copy()
    arguments = position, tilt, measured, yaw_rad, *variances, TILTED, np.full(SIZE, np.inf), 1e3
    assert correct_tilt(found, left, *arguments) == (measured, True)
    for number in range(2):
        state, covariance = states[number], covariances[number]
        observed = np.zeros((4, SIZE))
        observed[:2, :2] = observed[2:, TILTED : TILTED + 2] = np.eye(2)
        observed[2:, -2:] = heading_matrix(yaw_rad)
        count = 4 if measured and number == 0 else 2
        observed, seen = observed[:count], np.concatenate((position, tilt))[:count]
        noise = np.diag(np.repeat(variances, 2)[:count])
        gain = covariance @ observed.T @ np.linalg.inv(observed @ covariance @ observed.T + noise)
        assert found[number] == pytest.approx(state + gain @ (seen - observed @ state))
        assert left[number] == pytest.approx((np.eye(SIZE) - gain @ observed) @ covariance, abs=1e-9)


def test_a_tilt_beyond_its_gate_is_left_out_and_states_stay_within_their_limits() -> None:
    states, limit = np.zeros((1, SIZE)), np.full(SIZE, 0.5)
    seen = np.array([2.0, 0.0]), np.array([0.0, 0.4]), True
    taken_in, _ = correct_tilt(states, np.eye(SIZE)[None], *seen, 0.0, 1e-3, 1e-3, TILTED, limit, 0.3)
    assert not taken_in
    assert states[0, 0] == 0.5
    assert states[0, TILTED + 1] == 0.0


def test_a_covariance_that_is_none_is_told_and_changes_nothing() -> None:
    states, covariances = np.zeros((2, SIZE)), np.stack([np.eye(SIZE), -np.eye(SIZE)])
    seen = np.ones(2), np.zeros(2), False
    _, definite = correct_tilt(states, covariances, *seen, 0.0, 1e-3, 1e-3, TILTED, np.ones(SIZE), 1.0)
    assert not definite
    assert states[0].any()
    assert not states[1].any()
    assert (covariances[1] == -np.eye(SIZE)).all()


@given(st.integers(0, 10_000))
def test_a_period_of_the_filter_on_lags_is_a_prediction_and_its_linearization(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle, state, sticks = rng.uniform(0.1, 1.0, size=PARAMETERS), rng.normal(size=16), rng.normal(size=4)
    constant, covariance, process = rng.normal(size=(16, 16)), positive(rng, 16), positive(rng, 16)
    found, spread = state.copy(), covariance.copy()
    middle_rad = predict_lags(found, spread, sticks, vehicle, 0.01, 2, constant, process)
    moved, held = np.empty(8), np.empty(4)
    predict_motion(vehicle, state[:8], state[8:12], sticks, state[12:], 0.01, 2, moved, held)
    jacobian = lag_jacobian(constant, state[:8], moved)
    assert np.array_equal(found, np.concatenate((moved, held, state[12:])))
    assert middle_rad == pytest.approx(state[3] + 0.5 * 0.02 * moved[7])
    assert spread == pytest.approx(jacobian @ covariance @ jacobian.T + process)


def take_in(
    state: np.ndarray,
    covariance: np.ndarray,
    pose: np.ndarray,
    near: float = np.inf,
    variance: np.ndarray | None = None,
    limit: np.ndarray | None = None,
) -> tuple[int, np.ndarray]:
    """What the filter on lags made of a pose, and the pose with the turns of the heading."""
    taken = np.full(4, np.nan)
    variance = np.full(4, 1e-3) if variance is None else variance
    limit = np.ones(4) if limit is None else limit
    outcome = correct_lags(
        state,
        covariance,
        pose[:3],
        pose[3],
        state.copy(),
        np.full(4, near),
        NoiseMeter(4).memory,
        0.02,
        np.full(4, 1e-9),
        variance,
        limit,
        taken,
    )
    return outcome, taken


@given(st.integers(0, 10_000), st.integers(-3, 3))
def test_a_pose_corrects_the_filter_on_lags_as_the_best_linear_estimate(seed: int, turns: int) -> None:
    rng = np.random.default_rng(seed)
    covariance, innovation, variance = positive(rng, 16), rng.normal(size=4), rng.uniform(0.1, 1.0, size=4)
    innovation[3] = np.clip(innovation[3], -3.1, 3.1)
    state, limit = rng.normal(size=16), rng.uniform(0.1, 1.0, size=4)
    gain = covariance[:, :4] @ np.linalg.inv(covariance[:4, :4] + np.diag(variance))
    expected = state + gain @ innovation
    left = covariance - gain @ covariance[:4]
    found, pose = state.copy(), state[:4] + innovation
    turned = pose + np.array([0.0, 0.0, 0.0, turns * math.tau])
    outcome, taken = take_in(found, covariance, turned, variance=variance, limit=limit)
    assert outcome == TAKEN_IN
    assert taken == pytest.approx(pose)
    assert found[:12] == pytest.approx(expected[:12])
    assert found[12:] == pytest.approx(np.clip(expected[12:], -limit, limit))
    assert covariance == pytest.approx(left, abs=1e-9)


@given(st.integers(0, 3), st.sampled_from([1.0, -1.0]), st.floats(0.0, 2.0))
def test_a_pose_is_far_beyond_five_deviations_and_what_is_near_besides(
    axis: int, side: float, factor: float
) -> None:
    state, covariance, pose = np.zeros(16), 3e-3 * np.eye(16), np.zeros(4)
    farthest = 0.02 + 5.0 * math.sqrt(3e-3 + 1e-3)
    pose[axis] = side * factor * farthest
    assume(abs(factor - 1.0) > 1e-6)
    outcome, _ = take_in(state, covariance, pose, near=0.02)
    assert outcome == (TAKEN_IN if factor < 1.0 else FAR)


@pytest.mark.parametrize("pose", [[np.nan, 0, 0, 0], [0, 0, np.inf, 0], [0, 0, 0, np.nan], [2e3, 0, 0, 0]])
def test_a_pose_that_is_none_is_far_from_everything_and_changes_nothing(pose: list[float]) -> None:
    state, covariance = np.zeros(16), np.eye(16)
    outcome, _ = take_in(state, covariance, np.array(pose, dtype=float))
    assert outcome == FAR
    assert not state.any()
    assert (covariance == np.eye(16)).all()


def test_a_covariance_on_lags_that_is_none_is_told_and_changes_nothing() -> None:
    covariance, state = np.eye(16), np.zeros(16)
    covariance[0, 1] = covariance[1, 0] = 2.0
    before = covariance.copy()
    outcome, _ = take_in(state, covariance, np.full(4, 1e-3))
    assert outcome == INDEFINITE
    assert not state.any()
    assert (covariance == before).all()
