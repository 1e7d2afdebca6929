"""Exact prediction of one vehicle under known inputs, and checks of the estimates that it starts from."""

import math
from typing import Any, Final

import numpy as np

from rcopterx.compiling.compiled import ANY_VECTOR, COUNT, NUMBER, VECTOR, compiled, part, record
from rcopterx.control.interfaces import Estimate, TiltEstimate
from rcopterx.control.models.lateral import LATERAL_STEP, LateralStep, lateral_system, predict_lateral
from rcopterx.control.models.linear import PERIOD_DIGITS
from rcopterx.vehicles.model import Model, MotionModel
from rcopterx.vehicles.state import (
    INPUT_SIZE,
    MOTION_SIZE,
    U_THRUST,
    U_YAW,
    XD_BODY,
    YAW,
    YAW_RATE,
    YD_BODY,
    ZD_BODY,
    Array,
    X,
    Y,
    Z,
)

TILT_ESTIMATE: Final[Any] = record(TiltEstimate, *4 * [ANY_VECTOR])
ESTIMATE: Final[Any] = record(Estimate, *3 * [ANY_VECTOR], TILT_ESTIMATE)


@compiled(ESTIMATE)
def is_finite(estimate: Estimate) -> bool:
    """Whether all numbers of an estimate are finite."""
    motion, actuator, disturbance, tilt = estimate
    core, servo, wind, trim = tilt
    for numbers in (motion, actuator, disturbance, core, servo, wind, trim):
        for number in numbers:
            if not math.isfinite(number):
                return False
    return True


def flaw_of(estimate: Estimate) -> str | None:
    """Return why an estimate is unusable; None if it is usable."""
    try:
        sizes = *map(len, estimate[:3]), *map(len, estimate.tilt[1:])
        if sizes == (MOTION_SIZE, INPUT_SIZE, INPUT_SIZE, *3 * [2 if estimate.has_tilt else 0]):
            return None if is_finite(estimate) else "the estimate is not finite"
    except TypeError:  # no vectors, or vectors of other numbers
        pass
    return "the estimate has another shape than a vehicle's, or other numbers than 64-bit floats"


LONGEST_STEP_S: Final = 0.0201  # longer periods are split, which keeps positions exact to micrometres


MOTION_MODEL: Final[Any] = record(MotionModel, *3 * [VECTOR], *3 * [NUMBER])


@part
def _follow(model: MotionModel, actuator: Array, target: Array, time_s: float) -> Array:
    """Actuators some time after they began to follow a target: first-order lags."""
    after = target.copy()
    for axis in range(4):
        lag_s = model.lag_s[axis]
        if lag_s > 0.0:
            after[axis] += (actuator[axis] - target[axis]) * math.exp(-time_s / lag_s)
    return after


@compiled(MOTION_MODEL, ANY_VECTOR, ANY_VECTOR, NUMBER)
def behind_gyro(model: MotionModel, sticks: Array, actuator: Array, yaw_rate_rad_s: float) -> Array:
    """Return the inputs that actuators follow, shape (4,): gyro and thrust change that of the yaw."""
    followed = sticks.copy()
    ahead = sticks[U_THRUST] - actuator[U_THRUST]
    followed[U_YAW] += model.thrust_coupling * ahead - model.gyro * yaw_rate_rad_s
    return followed


@part
def _stabilized(
    model: MotionModel, yaw_rate: float, actuator: Array, sticks: Array, yaw_push: float, time_s: float
) -> Array:
    """Sticks, that of yaw as gyro and thrust change it in the middle of a time."""
    half_s = 0.5 * time_s
    middle_rate = yaw_rate + half_s * (model.input_gain[U_YAW] * actuator[U_YAW] + yaw_push)
    return behind_gyro(model, sticks, _follow(model, actuator, sticks, half_s), middle_rate)


@compiled(MOTION_MODEL, *3 * [ANY_VECTOR])
def derivative(model: MotionModel, motion: Array, actuator: Array, disturbance: Array) -> Array:
    """Return the rates of the motion state by equation (1), shape (8,)."""
    c, s = math.cos(motion[YAW]), math.sin(motion[YAW])
    xd, yd, zd, yaw_rate = motion[XD_BODY], motion[YD_BODY], motion[ZD_BODY], motion[YAW_RATE]
    rates = np.empty(MOTION_SIZE)
    rates[X], rates[Y], rates[Z], rates[YAW] = c * xd - s * yd, s * xd + c * yd, zd, yaw_rate
    for axis in range(4):
        drag = model.damping[axis] * motion[XD_BODY + axis]
        rates[XD_BODY + axis] = model.input_gain[axis] * actuator[axis] + disturbance[axis] + drag
    rates[XD_BODY] += yaw_rate * yd
    rates[YD_BODY] -= yaw_rate * xd
    rates[ZD_BODY] -= model.gravity_m_s2
    return rates


@part
def in_body(heading_rad: float, x: float, y: float) -> tuple[float, float]:
    """Return a vector of the inertial frame in the frame of a body, R(psi)' v; with -psi the other way."""
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    return c * x + s * y, c * y - s * x


@compiled(MOTION_MODEL, *4 * [ANY_VECTOR], NUMBER, COUNT)
def integrate_motion(
    model: MotionModel,
    motion: Array,
    actuator: Array,
    sticks: Array,
    disturbance: Array,
    step_s: float,
    steps: int,
) -> tuple[Array, Array]:
    """Return motion and actuators after some steps of classical Runge-Kutta, shapes (8,) and (4,)."""
    motion, actuator, push = motion.copy(), actuator.copy(), disturbance.copy()
    half_s = 0.5 * step_s
    for _ in range(steps):
        rate = motion[YAW_RATE]
        start = _follow(model, actuator, _stabilized(model, rate, actuator, sticks, push[U_YAW], 0.0), 0.0)
        target = _stabilized(model, rate, actuator, sticks, push[U_YAW], half_s)
        middle = _follow(model, actuator, target, half_s)
        target = _stabilized(model, rate, actuator, sticks, push[U_YAW], step_s)
        end = _follow(model, actuator, target, step_s)
        f1 = derivative(model, motion, start, push)
        f2 = derivative(model, motion + half_s * f1, middle, push)
        f3 = derivative(model, motion + half_s * f2, middle, push)
        f4 = derivative(model, motion + step_s * f3, end, push)
        motion = motion + step_s / 6 * (f1 + 2 * f2 + 2 * f3 + f4)
        actuator = end
    return motion, actuator


@compiled(MOTION_MODEL, ANY_VECTOR, ANY_VECTOR, NUMBER, NUMBER)
def _follow_sticks(
    model: MotionModel, actuator: Array, sticks: Array, yaw_rate: float, period_s: float
) -> Array:
    steady = np.zeros(4)
    steady[U_THRUST] = actuator[U_THRUST]
    return _follow(model, actuator, _stabilized(model, yaw_rate, steady, sticks, 0.0, period_s), period_s)


def actuator_response(
    model: Model, actuator: Array, applied_input: Array, yaw_rate_rad_s: float, period_s: float
) -> Array:
    """Return the actuator states after a period at a constant yaw rate, shape (4,)."""
    return _follow_sticks(model.motion_model, actuator, applied_input, yaw_rate_rad_s, period_s)


def predict(model: Model, estimate: Estimate, applied_input: Array, period_s: float) -> Estimate:
    """Predict a vehicle through a period during which one input acts.

    Actuators follow their exact exponential response, that of yaw to what gyro and thrust make of its stick
    in the middle of a step. The motion (1) is integrated by Runge-Kutta steps, and the estimated disturbance
    lasts. Where the tilt is known, the horizontal motion follows the tilt model, and the wind fades.

    `applied_input` acts at the actuators (the transport delay has passed), shape (4,).
    """
    steps = steps_in(period_s)
    if model.tilt is None or not len(estimate.tilt.core):
        motion, actuator = integrate_motion(
            model.motion_model,
            estimate.motion,
            estimate.actuator,
            applied_input,
            estimate.disturbance,
            period_s / steps,
            steps,
        )
        return Estimate(motion, actuator, estimate.disturbance)
    system = lateral_system(model, round(period_s, PERIOD_DIGITS))
    motion, actuator, x = _predict_tilted(
        model.motion_model, system.step, estimate, applied_input, period_s / steps, steps
    )
    return Estimate(motion, actuator, estimate.disturbance, system.tilt_estimate(x))


def steps_in(period_s: float) -> int:
    """Return into how many steps a period is split."""
    return max(1, math.ceil(period_s / LONGEST_STEP_S))


@compiled(MOTION_MODEL, LATERAL_STEP, ESTIMATE, ANY_VECTOR, NUMBER, COUNT)
def _predict_tilted(
    model: MotionModel,
    lateral: LateralStep,
    estimate: Estimate,
    applied_input: Array,
    step_s: float,
    steps: int,
) -> tuple[Array, Array, Array]:
    """Return motion, actuators and the lateral state, which the horizontal motion follows."""
    before, (core, servo, wind, trim) = estimate.motion, estimate.tilt
    motion, actuator = integrate_motion(
        model, before, estimate.actuator, applied_input, estimate.disturbance, step_s, steps
    )
    start_rad, end_rad = before[YAW], motion[YAW]
    velocity = in_body(-start_rad, before[XD_BODY], before[YD_BODY])
    x = np.concatenate((before[:2], np.array(velocity), core, servo, wind, trim))
    x, _ = predict_lateral(lateral, x, applied_input[:2], 0.5 * (start_rad + end_rad))
    motion[X], motion[Y] = x[X], x[Y]
    motion[XD_BODY], motion[YD_BODY] = in_body(end_rad, x[2], x[3])
    return motion, actuator, x
