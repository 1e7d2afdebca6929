"""Analytic Jacobian of the model prediction over one period, for the extended Kalman filter.

In the body frame every axis is a linear chain: disturbance and lagged input push the velocity, the velocity
moves the position. A gyro feeds the yaw rate back, and a thrust that turns the vehicle joins the chains of
height and yaw. The chains depend on the period alone and are discretised exactly once; per step only
the heading, the turning of the body frame and the displacement enter. Products of yaw rate and period beyond
the first order are left out (under 1 % at the yaw rates of indoor helicopters).
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.linalg import expm

from rcopterx.native.kalman import lag_jacobian
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import (
    INPUT_SIZE,
    MOTION_SIZE,
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

ACTUATOR: Final = MOTION_SIZE
DISTURBANCE: Final = MOTION_SIZE + INPUT_SIZE
SIZE: Final = MOTION_SIZE + 2 * INPUT_SIZE
_VELOCITIES: Final = (XD_BODY, YD_BODY, ZD_BODY, YAW_RATE)
_POSITIONS: Final = (X, Y, Z, YAW)
_COUPLED: Final = (2, 3)
"""Axes of height and yaw."""


class Linearization:
    """Jacobians of `agents.prediction.predict` for one vehicle and one period.

    Parameters
    ----------
    model
        The vehicle.
    period_s
        Length of the period.

    Attributes
    ----------
    constant
        Jacobian of a vehicle at rest that heads along x, shape (16, 16).
    """

    def __init__(self, model: Model, period_s: float) -> None:
        constant = np.eye(SIZE)
        together = ((0,), (1,), _COUPLED) if model.thrust_coupling else ((0,), (1,), (2,), (3,))
        for axes in together:
            states = _states(axes)
            constant[np.ix_(states, states)] = _transition(model, axes, period_s)
        self.constant: Array = constant

    def jacobian(self, start: Array, end: Array) -> Array:
        """Derivative of the state after the period by the state before it.

        Parameters
        ----------
        start, end
            Motion states before and after the period, shape (8,).

        Returns
        -------
        Array
            Shape (16, 16), order: motion, actuators, disturbances.
        """
        return lag_jacobian(self.constant, start, end)


def _states(axes: Sequence[int]) -> list[int]:
    """Positions, velocities, actuators and disturbances of axes, in this order."""
    positions, velocities = [_POSITIONS[axis] for axis in axes], [_VELOCITIES[axis] for axis in axes]
    return positions + velocities + [ACTUATOR + axis for axis in axes] + [DISTURBANCE + axis for axis in axes]


def _transition(model: Model, axes: Sequence[int], period_s: float) -> Array:
    """Exact transition of axes, in the order of `_states`."""
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
