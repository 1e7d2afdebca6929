"""Analytic Jacobian of the prediction of motion over one period, for the extended Kalman filter.

In the body frame every axis is a linear chain: disturbance and lagged input push the velocity, the velocity
moves the position. A gyro feeds the yaw rate back, and a thrust that turns the vehicle joins the chains of
height and yaw. The chains depend on the period alone and are discretised exactly once; per step only the
heading, the turning of the body frame and the displacement enter. Products of yaw rate and period beyond the
first order are neglected (under 1 % at the yaw rates of indoor helicopters).
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.linalg import expm

from rcopterx.control.models.linear import cached_by_period
from rcopterx.vehicles.model import Model
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
    heading_matrix,
)

SIZE: Final = MOTION_SIZE + 2 * INPUT_SIZE
"""Motion, actuators, disturbances."""
MOTION: Final = slice(0, MOTION_SIZE)
ACTUATOR: Final = slice(MOTION_SIZE, MOTION_SIZE + INPUT_SIZE)
DISTURBANCE: Final = slice(MOTION_SIZE + INPUT_SIZE, SIZE)
_POSITIONS: Final = (X, Y, Z, YAW)
_VELOCITIES: Final = (XD_BODY, YD_BODY, ZD_BODY, YAW_RATE)
_COUPLED: Final = (U_THRUST, U_YAW)


@cached_by_period
def jacobian_at_rest(model: Model, period_s: float) -> Array:
    """Return the Jacobian of a vehicle at rest that heads along x, shape (16, 16)."""
    jacobian = np.eye(SIZE)
    groups = ((0,), (1,), _COUPLED) if model.thrust_coupling else ((0,), (1,), (2,), (3,))
    for axes in groups:
        states = [_POSITIONS[axis] for axis in axes] + [_VELOCITIES[axis] for axis in axes]
        states += [ACTUATOR.start + axis for axis in axes] + [DISTURBANCE.start + axis for axis in axes]
        jacobian[np.ix_(states, states)] = _transition(model, axes, period_s)
    return jacobian


def _transition(model: Model, axes: Sequence[int], period_s: float) -> Array:
    """Exact transition of positions, velocities, actuators and disturbances of axes, in this order."""
    count = len(axes)
    continuous = np.zeros((4 * count, 4 * count))
    without_lag = []
    for place, axis in enumerate(axes):
        position, velocity, actuator, disturbance = range(place, 4 * count, count)
        continuous[position, velocity] = 1.0
        continuous[velocity, velocity] = model.direct_damping[axis]
        continuous[velocity, disturbance] = 1.0
        lag_s = model.lag_s[axis]
        if lag_s == 0.0:
            without_lag.append(actuator)
            continue
        continuous[velocity, actuator] = model.input_gain[axis]
        continuous[actuator, velocity] = -model.rate_feedback[axis] / lag_s
        continuous[actuator, actuator] = -1.0 / lag_s
    if tuple(axes) == _COUPLED:
        continuous[5, 4] = -model.thrust_coupling / model.lag_s[U_YAW]
    transition: Array = expm(period_s * continuous)
    transition[without_lag, without_lag] = 0.0
    return transition


def jacobian(at_rest: Array, start: Array, end: Array) -> Array:
    """Return the derivative of the state after a period by the state before it, shape (16, 16).

    `at_rest` is `jacobian_at_rest`, `start` and `end` are the motion before and after, shape (8,).
    """
    F = at_rest.copy()
    F[:2] = heading_matrix(float(start[YAW])) @ at_rest[:2]
    F[:2, :2] = np.eye(2)
    # Everything else turns with the vehicle, so a turned start turns the displacement.
    F[X, YAW], F[Y, YAW] = start[Y] - end[Y], end[X] - start[X]
    turning = at_rest[YAW].copy()
    turning[YAW] = 0.0
    body = slice(XD_BODY, YD_BODY + 1)
    F[body] = heading_matrix(float(end[YAW] - start[YAW])).T @ at_rest[body]
    F[body] += np.outer((end[YD_BODY], -end[XD_BODY]), turning)
    return F
