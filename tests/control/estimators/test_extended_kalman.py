"""Promises of the extended Kalman filter: disturbances, the floor, its Jacobian."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.conditions import IDEAL, LABORATORY
from support.vehicle_types import COAXIAL, COAXIAL_LAG, TYPES

from rcopterx.control.estimators.filters import SIZE, jacobian, jacobian_at_rest
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.models.prediction import predict
from rcopterx.control.plugins import ESTIMATORS
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.model import IDENTIFIED, UNIDENTIFIED, Model, Uncertainty
from rcopterx.vehicles.state import Array

NewFlight = Callable[..., Any]
ON_FLOOR = BodyPose((0.2, -0.3, 0.0), 1.0)


def stacked(estimate: Estimate) -> Array:
    return np.concatenate([estimate.motion, estimate.actuator, estimate.disturbance])


def unstacked(state: Array) -> Estimate:
    return Estimate(state[:8], state[8:12], state[12:])


def vectors(size: int, low: float, high: float) -> st.SearchStrategy[Array]:
    return arrays(np.float64, size, elements=st.floats(low, high, allow_subnormal=False))


@settings(max_examples=60, deadline=None)
@given(
    model=st.sampled_from(list(TYPES.values())),
    motion=vectors(8, -1.5, 1.5),
    actuator=vectors(4, -0.4, 0.8),
    applied_input=vectors(4, -0.4, 0.8),
    period_s=st.sampled_from([0.005, 0.01, 0.02]),
)
def test_jacobian_is_the_derivative_of_the_prediction(
    model: Model, motion: Array, actuator: Array, applied_input: Array, period_s: float
) -> None:
    state = np.concatenate([motion, actuator, np.full(4, 0.1)])
    predicted = predict(model, unstacked(state), applied_input, period_s)
    found = jacobian(jacobian_at_rest(model, period_s), motion, predicted.motion)
    numeric = np.empty((SIZE, SIZE))
    for i in range(SIZE):
        step = np.zeros(SIZE)
        step[i] = 1e-4
        above = predict(model, unstacked(state + step), applied_input, period_s)
        below = predict(model, unstacked(state - step), applied_input, period_s)
        numeric[:, i] = (stacked(above) - stacked(below)) / 2e-4
    assert np.allclose(found, numeric, atol=3e-3, rtol=0.02)


def test_vehicle_without_lag_has_a_jacobian_too() -> None:
    model = replace(COAXIAL_LAG, lag_s=(0.0, 0.06, 0.0, 0.03))
    found = jacobian_at_rest(model, 0.02)
    assert np.array_equal(found[8], np.zeros(SIZE))
    assert not found[4, 8]
    assert found[5, 9] > 0


@pytest.mark.parametrize("axis", range(4))
def test_constant_disturbance_is_found(new_flight: NewFlight, axis: int) -> None:
    flight = new_flight(conditions=replace(LABORATORY, turbulence_rms=(0, 0, 0, 0), parameter_mismatch=0.0))
    flight.fly(4.0)
    expected = flight.model.b * flight.laboratory.plants["h1"].trim
    found = np.mean([flight.estimator.estimate.disturbance for _ in range(100) if flight.step()], axis=0)
    assert found[axis] == pytest.approx(expected[axis], abs=(0.03, 0.03, 0.05, 0.15)[axis])


def test_mismatch_of_the_thrust_gain_appears_as_vertical_disturbance(new_flight: NewFlight) -> None:
    flight = new_flight(conditions=replace(LABORATORY, turbulence_rms=(0, 0, 0, 0), trim_offset=0.0))
    flight.fly(3.0)
    true_gain = flight.laboratory.plants["h1"].model.input_gain[2]
    expected = 9.81 * (1 - COAXIAL_LAG.input_gain[2] / true_gain)
    assert flight.estimator.estimate.disturbance[2] == pytest.approx(expected, abs=0.15)


def test_turbulence_is_followed(new_flight: NewFlight) -> None:
    gusts = replace(IDEAL, turbulence_rms=(0.3, 0.3, 0.2, 1.0), turbulence_correlation_s=1.0)
    flight = new_flight(conditions=gusts)
    flight.fly(1.0)
    plant = flight.laboratory.plants["h1"]
    errors = []
    for _ in range(300):
        flight.step()
        before = np.array(plant.motion)
        wind = plant.turbulence
        c, s = np.cos(before[3]), np.sin(before[3])
        body = np.array([c * wind[0] + s * wind[1], c * wind[1] - s * wind[0], wind[2], wind[3]])
        errors.append(flight.estimator.estimate.disturbance - body)
    assert np.all(np.sqrt(np.mean(np.square(errors), axis=0)) < [0.15, 0.15, 0.15, 0.8])


def test_vehicle_at_rest_on_the_floor_winds_nothing_up(new_flight: NewFlight) -> None:
    flight = new_flight(start=ON_FLOOR)
    errors = flight.fly(20.0)
    assert np.all(np.abs(errors[:, :3]) < 0.003)
    assert np.all(errors[:, 4:] == 0.0)
    assert np.array_equal(flight.estimator.estimate.disturbance, np.zeros(4))
    assert flight.estimator.standing


@pytest.mark.parametrize("seed", range(5))
def test_take_off_starts_with_an_unspoilt_estimate(new_flight: NewFlight, seed: int) -> None:
    flight = new_flight(start=ON_FLOOR, seed=seed)
    flight.set_point = np.array([0.2, -0.3, 0.6, 1.0])
    flight.fly(5.0)
    flight.motors_on = True
    errors = flight.fly(2.0)
    assert not flight.laboratory.plants["h1"].on_floor
    assert np.all(np.abs(errors[:, :3]) < 0.02)
    assert np.all(np.abs(errors[:, 4:7]) < 0.35)
    assert np.all(np.abs(errors[50:, 4:7]) < 0.03)
    assert abs(flight.estimator.estimate.disturbance[2]) < 1.5
    assert flight.estimator.rejected == 0


def test_landing_is_recognised_by_the_estimator_itself(new_flight: NewFlight) -> None:
    flight = new_flight()
    flight.fly(1.0)
    for height in np.arange(1.0, -0.3, -0.01):
        flight.set_point[2] = height
        flight.step()
    flight.motors_on = False
    flight.fly(1.0)
    assert flight.laboratory.plants["h1"].on_floor
    assert flight.estimator.standing
    assert np.array_equal(flight.estimator.estimate.disturbance, np.zeros(4))
    assert np.all(np.abs(flight.error) < 0.005)


def test_free_fall_is_not_taken_for_standing(new_flight: NewFlight) -> None:
    flight = new_flight(start=BodyPose((0.0, 0.0, 2.5)))
    flight.set_point[2] = 2.5
    flight.fly(1.0)
    flight.motors_on = False
    for _ in range(25):
        assert flight.step()
        assert not flight.estimator.standing
    assert flight.true_motion[6] < -2.0
    assert abs(flight.error[6]) < 0.3


def test_start_in_the_air_is_not_taken_for_standing(new_flight: NewFlight) -> None:
    flight = new_flight()
    flight.step()
    assert not flight.estimator.standing


def test_vehicle_carried_to_its_place_by_hand_is_followed(new_flight: NewFlight) -> None:
    flight = new_flight(start=ON_FLOOR, conditions=IDEAL)
    flight.fly(0.5)
    plant = flight.laboratory.plants["h1"]
    for i in range(100):
        plant.place(BodyPose((0.2 + 0.008 * i, -0.3, 0.0), 1.0))
        assert flight.step()
    flight.fly(1.0)
    assert np.all(np.abs(flight.error) < 0.01)
    assert np.all(np.abs(flight.estimator.estimate.disturbance[:3]) < 2.51)


def test_disturbances_stay_within_their_limit(new_flight: NewFlight) -> None:
    flight = new_flight(
        conditions=replace(IDEAL, turbulence_rms=(2.0, 2.0, 0.0, 0.0)),
        settings={"disturbance_limit": [0.5, 0.5, 0.5, 2.0]},
    )
    flight.fly(2.0)
    assert np.all(np.abs(flight.estimator.estimate.disturbance) <= [0.5, 0.5, 0.5, 2.0])


@pytest.mark.parametrize("uncertainty", [IDENTIFIED, UNIDENTIFIED], ids=["identified", "unidentified"])
@pytest.mark.parametrize("lost", [0.25, 0.3, 0.4])
def test_a_battery_that_loses_its_thrust_is_estimated(lost: float, uncertainty: Uncertainty) -> None:
    model = replace(COAXIAL, uncertainty=uncertainty)
    estimator, level = ESTIMATORS.build("extended_kalman", model, 0.02, {}), np.zeros(2)
    estimator.reset(Measurement(np.array((0.0, 0.0, 1.0)), 0.0, level))
    for period in range(1500):
        left = 1.0 - lost * min(period / 1000, 1.0)
        estimator.predict(model.hover_input / left, 0.02)
        estimator.correct(Measurement(np.array((0.0, 0.0, 1.0)), 0.0, level))
    needed = model.gravity_m_s2 * (1.0 - 1.0 / (1.0 - lost))
    assert estimator.estimate.disturbance[2] == pytest.approx(needed, abs=0.05)
    assert estimator.estimate.motion[6] == pytest.approx(0.0, abs=0.01)


def test_stated_deviation_matches_the_actual_error(new_flight: NewFlight) -> None:
    flight = new_flight()
    flight.fly(1.0)
    errors = np.sqrt(np.mean(np.square(flight.fly(10.0)), axis=0))
    stated = np.sqrt(flight.estimator.lag_filter.P.diagonal()[:8])
    assert np.all(errors < 2.0 * stated)
    assert np.all(errors > 0.3 * stated)


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seen=st.lists(st.booleans(), min_size=100, max_size=100), frames=st.sampled_from([1, 4]))
def test_covariance_stays_symmetric_and_positive(
    new_flight: NewFlight, seen: list[bool], frames: int
) -> None:
    flight = new_flight(frames_per_period=frames)
    for visible in seen:
        flight.step(lambda measurement, visible=visible: measurement if visible else None)
    covariance = flight.estimator.lag_filter.P
    assert np.allclose(covariance, covariance.T, rtol=1e-9, atol=1e-15)
    assert np.linalg.eigvalsh(covariance).min() > -1e-12
