"""Exact prediction of one vehicle: what the model says it does under inputs that are known.

Estimators move on by it between poses, and the pilot bridges the transport delay with it. It is written in
plain floats because arrays of eight numbers cost more than the arithmetic on them.
"""

import math
from functools import lru_cache
from typing import Final

import numpy as np

from rcopterx.agents.flight.lateral import POSITION, VELOCITY, demand_matrix, lateral_system
from rcopterx.agents.interfaces import Estimate, TiltEstimate
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import (
    INPUT_SIZE,
    U_THRUST,
    U_YAW,
    XD_BODY,
    YAW,
    YAW_RATE,
    ZD_BODY,
    Array,
    heading_matrix,
)
from rcopterx.vehicles.tuples import Four

_LONGEST_STEP_S: Final = 0.0201
"""Beyond one 50 Hz period Runge-Kutta steps are split, which keeps positions exact to micrometres."""


def predict(model: Model, estimate: Estimate, applied_input: Array, period_s: float) -> Estimate:
    """Predict a vehicle through a period during which one input acts.

    Actuators follow their exact exponential response, that of yaw to what gyro and thrust make of its stick
    in the middle of a step. The motion (1) is integrated by classical Runge-Kutta steps of at most 20 ms, and
    the estimated disturbance is taken to last. Where the tilt is known, the horizontal motion follows the
    tilt model instead, and the wind fades.

    Parameters
    ----------
    model
        The vehicle.
    estimate
        What is known at the start of the period.
    applied_input
        Input at the actuators (the transport delay already passed), shape (4,).
    period_s
        Length of the period.

    Returns
    -------
    Estimate
        At the end of the period; the disturbance is the given one.
    """
    steps = max(1, math.ceil(period_s / _LONGEST_STEP_S))
    step_s = period_s / steps
    motion: list[float] = estimate.motion.tolist()
    actuator: list[float] = estimate.actuator.tolist()
    disturbance: list[float] = estimate.disturbance.tolist()
    sticks: list[float] = applied_input.tolist()
    for _ in range(steps):
        now = _after(model, motion, actuator, sticks, disturbance, 0.0)
        middle = _after(model, motion, actuator, sticks, disturbance, 0.5 * step_s)
        end = _after(model, motion, actuator, sticks, disturbance, step_s)
        pushes = (
            _push(model, now, disturbance),
            _push(model, middle, disturbance),
            _push(model, end, disturbance),
        )
        motion = _runge_kutta(model, motion, pushes, step_s)
        actuator = end
    predicted = Estimate(np.array(motion), np.array(actuator), estimate.disturbance)
    if estimate.tilt is None or model.tilt is None:
        return predicted
    return _with_tilt(model, estimate, estimate.tilt, predicted, applied_input, period_s)


def _with_tilt(
    model: Model, start: Estimate, tilt: TiltEstimate, end: Estimate, applied_input: Array, period_s: float
) -> Estimate:
    """The horizontal part of a prediction by the tilt model; heading and height are those of `end`."""
    system = lateral_system(model, period_s)
    yaw_rad, end_rad = float(start.motion[YAW]), float(end.motion[YAW])
    stick = applied_input[:2] + tilt.trim
    demand = demand_matrix(model, 0.5 * (yaw_rad + end_rad))
    state = np.concatenate(
        (
            start.motion[:2],
            heading_matrix(yaw_rad) @ start.motion[XD_BODY:ZD_BODY],
            tilt.core,
            demand @ tilt.servo,
            tilt.wind_m_s2,
        )
    )
    state = system.transition @ state + system.demand @ (demand @ stick)
    motion = end.motion.copy()
    motion[:2] = state[POSITION]
    motion[XD_BODY:ZD_BODY] = heading_matrix(end_rad).T @ state[VELOCITY]
    servo = stick + system.servo_pole * (tilt.servo - stick)
    after = TiltEstimate(state[system.core], servo, state[system.wind], tilt.trim)
    return Estimate(motion, end.actuator, end.disturbance, after)


def actuator_response(
    model: Model, actuator: Array, applied_input: Array, yaw_rate_rad_s: float, period_s: float
) -> Array:
    """Exact response of the actuator lags at a constant yaw rate.

    Parameters
    ----------
    model
        The vehicle.
    actuator
        Actuator states at the start of the period, shape (4,).
    applied_input
        Input that acts during the period, shape (4,).
    yaw_rate_rad_s
        What a gyro measures.
    period_s
        Length of the period.

    Returns
    -------
    Array
        Actuator states at its end, shape (4,).
    """
    turning = [*[0.0] * YAW_RATE, yaw_rate_rad_s]
    steady = [0.0, 0.0, float(actuator[U_THRUST]), 0.0]
    followed = _followed(model, turning, steady, applied_input.tolist(), [0.0] * INPUT_SIZE, period_s)
    return np.array(_after_lag(model, actuator.tolist(), followed, period_s))


def _after(
    model: Model,
    motion: list[float],
    actuator: list[float],
    sticks: list[float],
    disturbance: list[float],
    time_s: float,
) -> list[float]:
    """Actuators some time into a step."""
    followed = sticks
    if model.yaw_behind_rotors:
        followed = _followed(model, motion, actuator, sticks, disturbance, time_s)
    return _after_lag(model, actuator, followed, time_s)


def _followed(
    model: Model,
    motion: list[float],
    actuator: list[float],
    sticks: list[float],
    disturbance: list[float],
    time_s: float,
) -> list[float]:
    """Sticks with what gyro and thrust make of that of yaw in the middle of a time
    (`rcopterx.vehicles.model.input_behind_gyro`)."""
    pitch, roll, thrust, yaw = sticks
    half_s = 0.5 * time_s
    yaw_rate = motion[YAW_RATE] + half_s * (model.input_gain[U_YAW] * actuator[U_YAW] + disturbance[U_YAW])
    ahead = thrust - _after_lag(model, actuator, sticks, half_s)[U_THRUST]
    yaw += model.thrust_coupling * ahead - model.rate_feedback[U_YAW] * yaw_rate
    return [pitch, roll, thrust, yaw]


def _after_lag(model: Model, actuator: list[float], target: list[float], time_s: float) -> list[float]:
    kept = _kept(model.lag_s, time_s)
    return [u + (a - u) * share for a, u, share in zip(actuator, target, kept, strict=True)]


@lru_cache(maxsize=1024)
def _kept(lag_s: Four, time_s: float) -> tuple[float, ...]:
    """Share of its distance to the target that each actuator has left after a time."""
    return tuple(math.exp(-time_s / lag) if lag > 0.0 else 0.0 for lag in lag_s)


def _push(model: Model, actuator: list[float], disturbance: list[float]) -> Four:
    """Acceleration by actuators, disturbance and gravity."""
    pitch, roll, thrust, yaw = actuator
    b_x, b_y, b_z, b_yaw = model.input_gain
    d_x, d_y, d_z, d_yaw = disturbance
    return b_x * pitch + d_x, b_y * roll + d_y, b_z * thrust - model.gravity_m_s2 + d_z, b_yaw * yaw + d_yaw


def _derivative(damping: Four, motion: list[float], push: Four) -> tuple[float, ...]:
    """Equation (1) with the input terms summed up in `push`."""
    _, _, _, yaw, xd, yd, zd, yaw_rate = motion
    k_x, k_y, k_z, k_yaw = damping
    c, s = math.cos(yaw), math.sin(yaw)
    return (
        c * xd - s * yd,
        s * xd + c * yd,
        zd,
        yaw_rate,
        push[0] + k_x * xd + yaw_rate * yd,
        push[1] + k_y * yd - yaw_rate * xd,
        push[2] + k_z * zd,
        push[3] + k_yaw * yaw_rate,
    )


def _runge_kutta(model: Model, motion: list[float], pushes: tuple[Four, ...], step_s: float) -> list[float]:
    start, middle, end = pushes
    half_s, sixth_s = 0.5 * step_s, step_s / 6
    k = model.direct_damping
    f1 = _derivative(k, motion, start)
    f2 = _derivative(k, [m + half_s * f for m, f in zip(motion, f1, strict=True)], middle)
    f3 = _derivative(k, [m + half_s * f for m, f in zip(motion, f2, strict=True)], middle)
    f4 = _derivative(k, [m + step_s * f for m, f in zip(motion, f3, strict=True)], end)
    return [
        m + sixth_s * (a + 2 * b + 2 * c + d) for m, a, b, c, d in zip(motion, f1, f2, f3, f4, strict=True)
    ]
