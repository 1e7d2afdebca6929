"""Promises of every estimator that comes with the package."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from support.conditions import HELICOPTERS, IDEAL, LABORATORY
from support.vehicle_types import COAXIAL_LAG, TYPES

from rcopterx.control.estimators.base import PoseEstimator
from rcopterx.control.interfaces import Measurement
from rcopterx.control.plugins import ESTIMATORS
from rcopterx.simulator.plant import BodyPose
from rcopterx_studies.baselines.finite_difference import FiniteDifferenceEstimator, FiniteDifferenceSettings

NewFlight = Callable[..., Any]
every_estimator = pytest.mark.parametrize("name", [*ESTIMATORS.built_in, "kalman", "finite_difference"])
VELOCITY_BOUND_M_S = {"extended_kalman": 0.008, "kalman": 0.02, "finite_difference": 0.02}
DRAWN_VEHICLE = 2.5
"""How much larger errors may be for a helicopter of which only the type is known."""
YAW_RATE_BOUND_RAD_S = {"extended_kalman": 0.05, "kalman": 0.2, "finite_difference": 0.2}


def rms(errors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(np.square(errors), axis=0))


@every_estimator
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.campaign) for seed in (1, 2))])
@pytest.mark.parametrize("kind", TYPES)
def test_velocity_error_in_the_laboratory_stays_within_its_bound(
    new_flight: NewFlight, name: str, seed: int, kind: str
) -> None:
    conditions = LABORATORY if TYPES[kind].tilt is None else HELICOPTERS
    flight = new_flight(name, model=TYPES[kind], conditions=conditions, seed=seed)
    flight.fly(1.0)
    flight.set_point = np.array([0.5, 0.3, 1.2, math.pi / 2])
    errors = rms(flight.fly(6.0))
    assert np.all(errors[:3] < 0.0005)
    drawn = 1.0 if conditions is LABORATORY else DRAWN_VEHICLE
    assert errors[3] < drawn * 0.003
    assert np.all(errors[4:7] < drawn * VELOCITY_BOUND_M_S[name])
    assert errors[7] < drawn * YAW_RATE_BOUND_RAD_S[name]
    assert flight.estimator.rejected == 0


@pytest.mark.parametrize("name", ["extended_kalman", "kalman"])
@pytest.mark.parametrize("kind", TYPES)
def test_the_stated_uncertainty_fits_the_errors_and_grows_without_poses(
    new_flight: NewFlight, name: str, kind: str
) -> None:
    flight = new_flight(name, model=TYPES[kind])
    errors_m = rms(flight.fly(2.0))[:3]
    stated_m = flight.estimator.position_deviation_m()
    assert stated_m.shape == (3,)
    assert np.all(errors_m < 2.0 * stated_m)
    assert np.all(stated_m < 0.001)
    for _ in range(10):
        flight.estimator.predict(flight.model.hover_input, 0.02)
    assert np.all(flight.estimator.position_deviation_m() > 4.0 * stated_m)


@every_estimator
@pytest.mark.parametrize("frames_per_period", [1, 2, 4])
def test_every_frame_from_50_to_200_hz_feeds_the_estimate(
    new_flight: NewFlight, name: str, frames_per_period: int
) -> None:
    flight = new_flight(name, frames_per_period=frames_per_period)
    flight.fly(1.0)
    flight.set_point = np.array([0.3, -0.3, 1.0, -1.0])
    assert np.all(rms(flight.fly(4.0))[4:7] < 1.5 * VELOCITY_BOUND_M_S[name])


@every_estimator
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_yaw_is_unwrapped_through_several_turns(new_flight: NewFlight, name: str, direction: float) -> None:
    flight = new_flight(name)
    for turned in np.arange(0.0, 5 * math.pi, 0.04):
        flight.set_point[3] = direction * turned
        assert flight.step()
        assert abs(flight.error[3]) < 0.1
    flight.fly(3.0)
    assert abs(flight.estimator.estimate.motion[3]) > 4.5 * math.pi


@every_estimator
def test_reset_on_the_way_keeps_the_count_of_turns(new_flight: NewFlight, name: str) -> None:
    flight = new_flight(name, conditions=IDEAL, start=BodyPose((0.0, 0.0, 1.0), math.pi - 0.01))
    flight.set_point[3] = math.pi + 0.3
    flight.fly(3.0)
    flight.estimator.reset(flight.measurement())
    assert flight.estimator.estimate.motion[3] == pytest.approx(math.pi + 0.3, abs=0.05)


@every_estimator
def test_first_yaw_may_already_be_unwrapped(name: str) -> None:
    estimator = ESTIMATORS.build(name, COAXIAL_LAG, 0.02, {})
    estimator.reset(Measurement(np.array([0.0, 0.0, 1.0]), 3 * math.pi))
    estimator.predict(COAXIAL_LAG.hover_input, 0.02)
    assert estimator.correct(Measurement(np.array([0.0, 0.0, 1.0]), -math.pi + 0.01))
    assert estimator.estimate.motion[3] == pytest.approx(3 * math.pi, abs=0.02)


@every_estimator
def test_first_pose_starts_an_estimator_that_was_not_reset(name: str) -> None:
    estimator = ESTIMATORS.build(name, COAXIAL_LAG, 0.02, {})
    assert estimator.correct(Measurement(np.array([5.0, 2.0, 1.0]), 2.0))
    assert np.allclose(estimator.estimate.motion, [5.0, 2.0, 1.0, 2.0, 0, 0, 0, 0])


@every_estimator
def test_occlusion_of_300_ms_is_ridden_out(new_flight: NewFlight, name: str) -> None:
    for seed in range(5):
        flight = new_flight(name, seed=seed)
        flight.fly(1.0)
        flight.set_point = np.array([0.5, 0.3, 1.0, 0.5])
        flight.fly(0.8)
        for _ in range(15):
            flight.step(lambda _: None)
        assert np.all(np.abs(flight.error[:3]) < 0.15)
        assert flight.step()
        flight.fly(0.5)
        assert np.all(np.abs(flight.error[4:7]) < 0.1)
        assert (flight.estimator.rejected, flight.estimator.restarts) == (0, 0)


def turned_round(measurement: Measurement) -> Measurement:
    return replace(measurement, yaw_rad=measurement.yaw_rad + math.pi)


def mixed_up(measurement: Measurement) -> Measurement:
    return replace(measurement, position_m=measurement.position_m + np.array([0.0, 0.4, 0.0]))


@every_estimator
@pytest.mark.parametrize("swap", [turned_round, mixed_up])
def test_marker_swap_is_refused_and_counted(
    new_flight: NewFlight, name: str, swap: Callable[[Measurement], Measurement]
) -> None:
    flight = new_flight(name)
    flight.fly(2.0)
    for _ in range(6):
        assert not flight.step(swap)
    assert flight.estimator.rejected == 6
    assert np.all(np.abs(flight.error[:3]) < 0.06)
    assert abs(flight.error[3]) < 0.3
    assert flight.step()
    assert flight.estimator.restarts == 0


@every_estimator
def test_the_estimate_follows_the_motion_of_refused_poses(new_flight: NewFlight, name: str) -> None:
    flights = [new_flight(name), new_flight(name)]
    estimates = []
    for flight, changed in zip(flights, (mixed_up, lambda measurement: measurement), strict=True):
        flight.fly(1.0)
        flight.set_point = np.array([0.5, 0.3, 1.0, 0.0])
        for _ in range(10):
            flight.step(changed)
        estimates.append(flight.estimator.estimate.motion)
    assert flights[0].estimator.rejected == 10
    assert np.allclose(*estimates, atol=0.01)


@every_estimator
@pytest.mark.parametrize("fall_m_s", [1.2, 1.7, 2.5])
def test_an_impact_on_the_floor_is_not_taken_for_a_fall_through_it(name: str, fall_m_s: float) -> None:
    estimator = ESTIMATORS.build(name, COAXIAL_LAG, 0.02, {})
    estimator.reset(Measurement(np.array([0.0, 0.0, 1.0]), 0.0))
    heights_m = [*np.arange(1.0, 0.0, -0.02 * fall_m_s), *10 * [0.0]]
    for height_m in heights_m:
        estimator.predict(COAXIAL_LAG.hover_input, 0.02)
        estimator.correct(Measurement(np.array([0.0, 0.0, height_m]), 0.0))
    assert abs(estimator.estimate.motion[2]) < 0.12
    assert abs(estimator.estimate.motion[6]) < 0.4


class WithoutMove(FiniteDifferenceEstimator):
    """Like estimators of packages, which need not define how they are moved."""

    _move = PoseEstimator._move


def test_an_estimator_that_does_not_define_how_it_is_moved_keeps_its_velocity() -> None:
    estimator = WithoutMove(COAXIAL_LAG, 0.02, FiniteDifferenceSettings())
    estimator.reset(Measurement(np.array([0.0, 0.0, 1.0]), 0.0))
    for number in range(1, 60):
        estimator.predict(COAXIAL_LAG.hover_input, 0.02)
        aside_m = 0.06 if number > 55 else 0.0
        estimator.correct(Measurement(np.array([0.01 * number, aside_m, 1.0]), 0.0))
    assert estimator.rejected == 1
    assert estimator.estimate.motion[:2] == pytest.approx([0.59, 0.06], abs=0.001)
    assert estimator.estimate.motion[4:6] == pytest.approx([0.5, 0.0], abs=0.05)


@every_estimator
def test_vehicle_that_was_really_moved_is_found_again_after_the_gate_limit(
    new_flight: NewFlight, name: str
) -> None:
    flight = new_flight(name, settings={"gate_limit_s": 0.2})
    flight.fly(1.0)
    flight.laboratory.plants["h1"].place(BodyPose((1.0, -1.0, 0.5), 2.0))
    accepted = [flight.step() for _ in range(12)]
    assert accepted == [False] * 10 + [True] * 2
    assert (flight.estimator.rejected, flight.estimator.restarts) == (11, 1)
    flight.fly(1.0)
    assert np.all(np.abs(flight.error[:3]) < 0.005)
    assert np.all(np.abs(flight.error[4:7]) < 0.15)


@every_estimator
def test_poses_that_jump_about_never_open_the_gate(new_flight: NewFlight, name: str) -> None:
    flight = new_flight(name, conditions=IDEAL)
    flight.fly(0.5)
    for i in range(25):
        away = [2.0 * math.cos(2.0 * i), 2.0 * math.sin(2.0 * i), 0.0]
        measurement = Measurement(np.array([0.0, 0.0, 1.0]) + away, 0.0)
        assert not flight.step(lambda _, measurement=measurement: measurement)
    assert flight.estimator.restarts == 0
    assert np.all(np.abs(flight.error[:3]) < 0.01)


@every_estimator
@pytest.mark.parametrize(
    "measurement",
    [
        Measurement(np.array([math.nan, 0.0, 1.0]), 0.0),
        Measurement(np.array([0.0, math.inf, 1.0]), 0.0),
        Measurement(np.array([0.0, 0.0, 1.0]), math.nan),
        Measurement(np.array([0.0, 0.0, 1e200]), 0.0),
        Measurement(np.array([0.0, 0.0, 1.0]), math.inf),
    ],
)
def test_unreadable_pose_is_refused_counted_and_changes_nothing(name: str, measurement: Measurement) -> None:
    estimator = ESTIMATORS.build(name, COAXIAL_LAG, 0.02, {})
    estimator.reset(Measurement(np.array([0.0, 0.0, 1.0]), 0.0))
    estimator.predict(COAXIAL_LAG.hover_input, 0.02)
    before = estimator.estimate.motion.copy()
    assert not estimator.correct(measurement)
    assert estimator.rejected == 1
    assert np.array_equal(estimator.estimate.motion, before)
    with pytest.raises(ValueError, match="cannot start at"):
        estimator.reset(measurement)


@every_estimator
def test_non_finite_input_is_refused(name: str) -> None:
    estimator = ESTIMATORS.build(name, COAXIAL_LAG, 0.02, {})
    estimator.reset(Measurement(np.array([0.0, 0.0, 1.0]), 0.0))
    with pytest.raises(ValueError, match="is not finite"):
        estimator.predict(np.array([0.0, math.nan, 0.5, 0.0]), 0.02)


poses = st.builds(
    lambda *numbers: Measurement(np.array(numbers[:3]), numbers[3]),
    *[st.floats(allow_nan=True, allow_infinity=True) | st.floats(-3, 3)] * 4,
)
moves = st.tuples(st.tuples(*[st.floats(-1, 1)] * 4), st.sampled_from([0.005, 0.02, 0.1]), st.none() | poses)


@every_estimator
@settings(max_examples=40, deadline=None)
@given(history=st.lists(moves, max_size=40))
def test_estimate_is_finite_whatever_happens(
    name: str, history: list[tuple[tuple[float, ...], float, Measurement | None]]
) -> None:
    estimator = ESTIMATORS.build(name, COAXIAL_LAG, 0.02, {"gate_limit_s": 0.02})
    estimator.reset(Measurement(np.array([0.0, 0.0, 1.0]), 0.0))
    for applied_input, period_s, measurement in history:
        estimator.predict(np.array(applied_input), period_s)
        if measurement is not None:
            estimator.correct(measurement)
        estimate = estimator.estimate
        assert np.isfinite([*estimate.motion, *estimate.actuator, *estimate.disturbance]).all()


@every_estimator
def test_actuator_states_follow_the_applied_inputs_and_survive_a_reset(name: str) -> None:
    estimator = ESTIMATORS.build(name, COAXIAL_LAG, 0.02, {})
    estimator.reset(Measurement(np.zeros(3), 0.0))
    estimator.predict(np.zeros(4), 0.02)
    assert np.array_equal(estimator.estimate.actuator, np.zeros(4))
    applied_input = np.array([0.5, -0.5, 0.4, 0.1])
    estimator.predict(applied_input, 0.02)
    expected = applied_input * (1 - np.exp(-0.02 / np.array(COAXIAL_LAG.lag_s)))
    assert np.allclose(estimator.estimate.actuator, expected)
    estimator.reset(Measurement(np.zeros(3), 0.0))
    assert np.allclose(estimator.estimate.actuator, expected)


@every_estimator
def test_estimates_handed_out_do_not_change_afterwards(new_flight: NewFlight, name: str) -> None:
    flight = new_flight(name)
    flight.fly(0.2)
    handed_out = flight.estimator.estimate
    copies = [part.copy() for part in (handed_out.motion, handed_out.actuator, handed_out.disturbance)]
    flight.fly(0.2)
    assert np.array_equal(handed_out.motion, copies[0])
    assert np.array_equal(handed_out.actuator, copies[1])
    assert np.array_equal(handed_out.disturbance, copies[2])
