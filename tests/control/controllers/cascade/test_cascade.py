"""The yaw-first cascade: exact following, limits, switches."""

from dataclasses import replace

import numpy as np
import pytest
from support.records import replace as changed
from support.vehicle_types import COAXIAL, COAXIAL_LAG

from rcopterx.control.controllers.cascade.controller import CascadeController, CascadeSettings
from rcopterx.control.interfaces import ControlStep, Estimate, TiltEstimate
from rcopterx.control.models import prediction
from rcopterx.control.models.roll_out import predict
from rcopterx.control.references.set_points import smooth_move
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array, heading_matrix

PERIOD_S = 0.02
HOVER = COAXIAL_LAG.hover_input


def state(motion: Array | None = None, disturbance: Array | None = None) -> Estimate:
    at = np.array([0, 0, 1.0, 0, 0, 0, 0, 0]) if motion is None else motion
    return Estimate(at, HOVER.copy(), np.zeros(4) if disturbance is None else disturbance)


def make(model: Model = COAXIAL_LAG, **settings: object) -> CascadeController:
    return CascadeController(model, PERIOD_S, CascadeSettings(**settings))  # type: ignore[arg-type]  # free-form test settings


def first_step(controller: CascadeController, start: Estimate, target: Array) -> ControlStep:
    controller.reset(start, HOVER)
    return controller.step(start, hold(target[:3], float(target[3]), PERIOD_S, controller.horizon), HOVER)


def test_a_plan_behind_a_gyro_is_what_the_discrete_model_does_under_its_inputs() -> None:
    """With turning and climbing, and sticks within their range: beyond it the thrust turns the vehicle."""
    model = replace(COAXIAL_LAG, yaw_gyro=True, thrust_coupling=2.0)
    start = state(np.array([0.1, -0.2, 1.0, 0.4, 0.3, -0.2, 0.0, 0.3]), np.array([0.1, -0.1, 0.2, 0.3]))
    result = first_step(make(model, horizon=60), start, np.array([0.6, 0.3, 1.02, 0.6]))
    assert np.abs(result.inputs[:, 3]).max() < 0.4
    expected = predict(model, start, result.inputs, PERIOD_S)
    assert result.plan.samples[:, :4] == pytest.approx(expected.samples[:, :4], abs=2e-4)
    ignored = predict(replace(model, thrust_coupling=0.0), start, result.inputs, PERIOD_S)
    assert np.abs(ignored.samples[:, 3] - expected.samples[:, 3]).max() > 0.02


def test_a_plan_is_what_the_discrete_model_does_under_its_inputs() -> None:
    """With turning, climbing and saturated inputs."""
    start = state(np.array([0.1, -0.2, 1.0, 0.4, 0.3, -0.2, 0.1, 1.0]), np.array([0.1, -0.1, 0.2, 0.3]))
    result = first_step(make(horizon=60), start, np.array([0.6, 0.3, 1.3, 2.5]))
    assert result.fallback is None
    assert np.abs(result.inputs[:, 3]).max() == pytest.approx(0.4, abs=1e-3)
    expected = predict(COAXIAL_LAG, start, result.inputs, PERIOD_S)
    assert result.plan.samples[:, :4] == pytest.approx(expected.samples[:, :4], abs=2e-4)
    assert result.plan.samples[:-2, 4:8] == pytest.approx(expected.samples[:-2, 4:8], abs=1e-3)
    assert np.diff(result.plan.samples[:, :4], axis=0) / PERIOD_S == pytest.approx(
        result.plan.samples[:-1, 4:8]
    )
    accelerations = result.plan.samples[:-1, 8:]
    assert np.diff(result.plan.samples[:, 4:8], axis=0) / PERIOD_S == pytest.approx(accelerations)


@pytest.mark.parametrize("offset_yaw", [0.0, np.pi / 2, np.pi, -2.0])
def test_a_follower_reproduces_its_leaders_plan_exactly(offset_yaw: float) -> None:
    """The feed-forward inverts the model, at any relative heading, so nothing is left to the feedback."""
    motion = np.array([0.0, 0.1, 1.0, 0.2, 0, 0, 0, 0])
    half = {
        name: tuple((0.5 * (HOVER + limit)).tolist())
        for name, limit in (("input_min", COAXIAL_LAG.u_min), ("input_max", COAXIAL_LAG.u_max))
    }
    leader = make(horizon=50, **half)
    plan = first_step(leader, state(motion), np.array([0.15, 0.0, 1.1, 0.6])).plan
    samples = plan.samples.copy()
    samples[:, :3] += [0.3, 0.2, 0.1]
    samples[:, 3] += offset_yaw
    own = samples[0, :8].copy()
    own[4:6] = heading_matrix(offset_yaw).T @ own[4:6]
    follower = make(horizon=50)
    start = state(own)
    follower.reset(start, HOVER)
    result = follower.step(start, Trajectory(samples, PERIOD_S), HOVER)
    assert result.plan.samples[:, :8] == pytest.approx(samples[:, :8], abs=1e-4)


@pytest.mark.parametrize("yaw", [0.0, np.pi / 2, np.pi, -1.0])
def test_reference_flying_along_x_is_flown_along_x_at_any_heading(yaw: float) -> None:
    samples = hold(np.array([0, 0, 1.0]), yaw, PERIOD_S, 30).samples.copy()
    samples[:, 0] = 0.05 * PERIOD_S * np.arange(30)
    samples[:, 4] = 0.05
    controller = make(horizon=30)
    start = state(np.array([0, 0, 1.0, yaw, 0, 0, 0, 0]))
    controller.reset(start, HOVER)
    result = controller.step(start, Trajectory(samples, PERIOD_S), HOVER)
    push = heading_matrix(yaw) @ (COAXIAL_LAG.b[:2] * result.inputs[0, :2])
    assert push[0] > 0.05
    assert abs(push[1]) < 0.02 * push[0]


def test_feed_forward_flies_an_accelerating_reference_closer() -> None:
    samples = hold(np.array([0, 0, 1.0]), 0.0, PERIOD_S, 30).samples.copy()
    samples[:, 8] = 0.4
    samples[:, 4] = 0.4 * PERIOD_S * np.arange(30)
    samples[1:, 0] = PERIOD_S * np.cumsum(samples[:-1, 4])
    errors = []
    for feed_forward in (True, False):
        controller = make(horizon=30, feed_forward=feed_forward)
        moving = Estimate(state().motion, HOVER + np.array([0.2, 0, 0, 0]), np.zeros(4))
        controller.reset(moving, HOVER)
        plan = controller.step(moving, Trajectory(samples, PERIOD_S), HOVER).plan
        errors.append(np.abs(plan.position_m - samples[:, :3]).max())
    assert errors[0] < 0.5 * errors[1]


def test_a_way_is_flown_closely_while_the_bar_creeps_and_the_axes_couple() -> None:
    assert COAXIAL.tilt is not None
    controller, hover, still = make(COAXIAL, horizon=30), COAXIAL.hover_input, np.zeros(2)
    tilt = TiltEstimate(np.zeros(COAXIAL.tilt.dynamics().size), still, still, still)
    vehicle = changed(state(), actuator=hover, tilt=tilt)
    way = smooth_move(np.array([0.0, 0.0, 1.0]), np.array([0.4, 0.1, 1.0]), 0.0, 0.0, 0.5)
    controller.reset(vehicle, hover)
    for period in range(110):
        reference = way.sample(period * PERIOD_S, PERIOD_S, controller.horizon)
        assert vehicle.motion[:2] == pytest.approx(reference.position_m[0, :2], abs=0.006)
        sticks = controller.step(vehicle, reference, hover).inputs[0]
        vehicle = prediction.predict(COAXIAL, vehicle, sticks, PERIOD_S)


def test_a_step_that_is_still_ahead_is_prepared_for() -> None:
    """Preview: with the step in the second half of the horizon the vehicle is on its way before it comes."""
    controller = make(horizon=40)
    start = state()
    controller.reset(start, HOVER)
    samples = hold(start.motion[:3], 0.0, PERIOD_S, 40).samples.copy()
    samples[20:, 0] = 0.3
    previewed = controller.step(start, Trajectory(samples, PERIOD_S), HOVER).plan.position_m[:, 0]
    assert 0.05 < previewed[20] < 0.25
    unaware = first_step(make(horizon=40), start, start.motion[:4]).plan.position_m[:, 0]
    assert unaware[20] == pytest.approx(0.0, abs=1e-6)


def test_estimated_disturbance_is_balanced_without_an_error() -> None:
    push = np.array([0.2, -0.15, 0.3, 1.0])
    result = first_step(make(), state(disturbance=push), np.array([0, 0, 1.0, 0]))
    assert result.inputs[-1] == pytest.approx(HOVER - push / COAXIAL_LAG.b, abs=5e-3)
    ignored = first_step(
        make(disturbance_compensation=False, integrators=False),
        state(disturbance=push),
        np.array([0, 0, 1.0, 0]),
    )
    assert ignored.inputs[0] == pytest.approx(HOVER, abs=1e-6)


def test_a_trim_that_no_estimator_tells_is_learnt() -> None:
    """An estimator without disturbances leaves the integral action to remove the error."""
    trim = np.array([0.03, -0.02, 0.01, 0.0])
    controller = make(horizon=30)
    start = state()
    controller.reset(start, HOVER)
    motion, actuator, last = start.motion, HOVER, HOVER
    reference = hold(np.array([0, 0, 1.0]), 0.0, PERIOD_S, 30)
    for _ in range(400):
        last = controller.step(Estimate(motion, actuator, np.zeros(4)), reference, last).inputs[0]
        ahead = predict(
            COAXIAL_LAG, Estimate(motion, actuator, COAXIAL_LAG.b * trim), np.tile(last, (2, 1)), PERIOD_S
        )
        motion = ahead.samples[1, :8]
        actuator = actuator + (1 - np.exp(-PERIOD_S / np.array(COAXIAL_LAG.lag_s))) * (last - actuator)
    assert motion[:3] == pytest.approx([0, 0, 1], abs=2e-3)


def test_first_step_after_a_switch_takes_over_the_trim() -> None:
    trimmed = HOVER + np.array([0.05, -0.04, 0.01, 0.0])
    controller = make(horizon=40)
    hovering = Estimate(state().motion, trimmed, np.zeros(4))
    controller.reset(hovering, trimmed)
    result = controller.step(hovering, hold(np.array([0, 0, 1.0]), 0.0, PERIOD_S, 40), trimmed)
    assert result.inputs[0] == pytest.approx(trimmed, abs=1e-3)


def test_reset_forgets_the_filtered_disturbance_of_the_last_flight() -> None:
    settings = {"effort_factors": (3.0, 1.0, 3.0), "integrators": False}
    used, fresh = make(**settings), make(**settings)
    place = np.array([0.0, 0.0, 1.0, 0.0])
    for _ in range(50):
        first_step(used, state(disturbance=np.array([0.5, 0.0, 0.0, 4.0])), place)
    assert first_step(used, state(), place).inputs == pytest.approx(first_step(fresh, state(), place).inputs)


def test_first_step_with_raised_efforts_balances_the_estimated_disturbance() -> None:
    push = np.array([0.2, -0.15, 0.0, 1.0])
    result = first_step(
        make(effort_factors=(3.0, 1.0, 3.0)), state(disturbance=push), np.array([0.0, 0.0, 1.0, 0.0])
    )
    assert result.inputs[-1] == pytest.approx(HOVER - push / COAXIAL_LAG.b, abs=5e-3)


def test_speed_bounds_are_kept_softly() -> None:
    """A long way is planned at the speed bound, hardly above it; no problem is infeasible."""
    result = first_step(
        make(horizon=110), state(np.array([-1.1, 0, 1.0, 0, 0, 0, 0, 0])), np.array([1.1, 0, 1, 0])
    )
    assert result.fallback is None
    assert result.plan.velocity_m_s[:, 0].max() == pytest.approx(1.0, abs=0.02)
    too_fast = first_step(make(), state(np.array([0, 0, 1.0, 0, 1.9, 0, 0, 4.0])), np.array([0, 0, 1.0, 0]))
    assert too_fast.fallback is None
    assert (np.abs(too_fast.inputs[0] - HOVER) > 0).any()


def test_anisotropic_weights_fly_at_any_heading() -> None:
    weights = (800.0, 400.0, 800.0, 40.0, 1.0, 2.0, 1.0, 1.0)
    for yaw in (0.0, 1.0, 4.0):
        start = state(np.array([0.02, 0.02, 1.0, yaw, 0, 0, 0, 0]))
        result = first_step(make(state_weights=weights), start, np.array([0, 0, 1.0, yaw]))
        assert result.fallback is None
        assert result.plan.position_m[-1] == pytest.approx([0, 0, 1], abs=2e-3)
