"""Promises of the model prediction."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp
from support.equation_one import input_behind_gyro, motion_derivative
from support.records import replace as changed
from support.vehicle_types import COAXIAL_LAG, TYPES

from rcopterx.control.interfaces import NO_TILT, Estimate
from rcopterx.control.models.prediction import predict
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import MOTION_SIZE, U_YAW, YAW_RATE, Array

models = st.sampled_from(list(TYPES.values()))
periods_s = st.sampled_from([0.005, 0.01, 0.02, 0.04])


def vectors(size: int, low: float, high: float) -> st.SearchStrategy[Array]:
    return arrays(np.float64, size, elements=st.floats(low, high, allow_subnormal=False))


estimates = st.builds(Estimate, vectors(8, -2, 2), vectors(4, -0.5, 0.8), vectors(4, -1, 1), st.just(NO_TILT))
inputs = vectors(4, -0.4, 0.8)


def fine_integration(model: Model, estimate: Estimate, applied_input: Array, duration_s: float) -> Array:
    def derivative(_: float, state: Array) -> Array:
        motion, actuator = state[:MOTION_SIZE], state[MOTION_SIZE:]
        followed = input_behind_gyro(model, motion, actuator, applied_input)
        rate = motion_derivative(model, motion, actuator, estimate.disturbance)
        return np.concatenate((rate, (followed - actuator) / np.array(model.lag_s)))

    start = np.concatenate((estimate.motion, estimate.actuator))
    solution = solve_ivp(derivative, (0, duration_s), start, method="DOP853", rtol=1e-11, atol=1e-12)
    return np.asarray(solution.y[:MOTION_SIZE, -1])


@settings(max_examples=60, deadline=None)
@given(model=models, estimate=estimates, applied_input=inputs, period_s=periods_s)
def test_prediction_agrees_with_fine_integration(
    model: Model, estimate: Estimate, applied_input: Array, period_s: float
) -> None:
    predicted = predict(model, estimate, applied_input, period_s)
    expected = fine_integration(model, estimate, applied_input, period_s)
    assert np.allclose(predicted.motion[:3], expected[:3], atol=1e-5)
    assert np.allclose(predicted.motion[3:YAW_RATE], expected[3:YAW_RATE], atol=2e-4)
    assert predicted.motion[YAW_RATE] == pytest.approx(expected[YAW_RATE], abs=6e-3, rel=1e-5)


@settings(deadline=None)
@given(model=models, estimate=estimates, applied_input=inputs, period_s=periods_s)
def test_actuators_follow_their_exact_pole(
    model: Model, estimate: Estimate, applied_input: Array, period_s: float
) -> None:
    predicted = predict(model, estimate, applied_input, period_s)
    pole = np.exp(-period_s / np.array(model.lag_s))
    behind_gyro = U_YAW if model.yaw_gyro or model.thrust_coupling else None
    expected = applied_input + pole * (estimate.actuator - applied_input)
    assert np.allclose(predicted.actuator[:behind_gyro], expected[:behind_gyro])
    assert np.array_equal(predicted.disturbance, estimate.disturbance)


@settings(max_examples=60, deadline=None)
@given(estimate=estimates, applied_input=inputs, turn_rad=st.floats(-7, 7))
def test_prediction_is_the_same_in_every_heading(
    estimate: Estimate, applied_input: Array, turn_rad: float
) -> None:
    turn = np.eye(8)
    turn[:2, :2] = [[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]]
    offset = np.zeros(8)
    offset[3] = turn_rad
    turned = changed(estimate, motion=turn @ estimate.motion + offset)
    predicted = predict(COAXIAL_LAG, estimate, applied_input, 0.02).motion
    assert np.allclose(predict(COAXIAL_LAG, turned, applied_input, 0.02).motion, turn @ predicted + offset)


def test_two_half_periods_are_one_period() -> None:
    start = Estimate(np.linspace(-1, 1, 8), np.array([0.1, -0.2, 0.5, 0.05]), np.array([0.1, 0.2, 0.3, 1.0]))
    applied_input = np.array([0.3, 0.4, 0.6, -0.1])
    once = predict(COAXIAL_LAG, start, applied_input, 0.02)
    twice = predict(COAXIAL_LAG, predict(COAXIAL_LAG, start, applied_input, 0.01), applied_input, 0.01)
    assert np.allclose(once.motion, twice.motion, atol=1e-4)
    assert np.allclose(once.actuator, twice.actuator)


def test_hover_input_holds_a_hovering_vehicle() -> None:
    start = Estimate(np.array([0.1, 0.2, 1.0, 9.0, 0, 0, 0, 0]), COAXIAL_LAG.hover_input, np.zeros(4))
    end = start
    for _ in range(100):
        end = predict(COAXIAL_LAG, end, COAXIAL_LAG.hover_input, 0.02)
    assert np.allclose(end.motion, start.motion)


def test_vehicle_without_lag_takes_its_input_at_once() -> None:
    model = replace(COAXIAL_LAG, lag_s=(0.0, 0.0, 0.0, 0.0))
    start = Estimate(np.zeros(8), np.zeros(4), np.zeros(4))
    applied_input = np.array([0.5, 0.0, 0.545, 0.0])
    predicted = predict(model, start, applied_input, 0.02)
    assert np.array_equal(predicted.actuator, applied_input)
    assert predicted.motion[4] == pytest.approx(0.5 * 2.0 * (1 - np.exp(-0.5 * 0.02)) / 0.5)


def test_prediction_leaves_its_arguments_alone() -> None:
    start = Estimate(np.zeros(8), np.zeros(4), np.zeros(4))
    predict(COAXIAL_LAG, start, np.ones(4), 0.02)
    assert not start.motion.any()
    assert not start.actuator.any()
