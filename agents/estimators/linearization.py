"""Analytic Jacobian of the model prediction over one period, for the extended Kalman filter.

In the body frame every axis is a linear chain: disturbance and lagged input push the velocity, the velocity
moves the position. The chains depend on the period alone and are discretised exactly once; per step only
the heading, the turning of the body frame and the displacement enter. Products of yaw rate and period beyond
the first order are left out (under 1 % at the yaw rates of indoor helicopters).
"""

import math
from typing import Final

import numpy as np
from scipy.linalg import expm

from vehicles.model import Model
from vehicles.state import INPUT_SIZE, MOTION_SIZE, XD_BODY, YAW, YAW_RATE, YD_BODY, ZD_BODY, Array, X, Y, Z

ACTUATOR: Final = MOTION_SIZE
DISTURBANCE: Final = MOTION_SIZE + INPUT_SIZE
SIZE: Final = MOTION_SIZE + 2 * INPUT_SIZE
_VELOCITIES: Final = (XD_BODY, YD_BODY, ZD_BODY, YAW_RATE)
_POSITIONS: Final = (X, Y, Z, YAW)


class Linearization:
    """Jacobians of `agents.prediction.predict` for one vehicle and one period.

    Parameters
    ----------
    model
        The vehicle.
    period_s
        Length of the period.
    """

    def __init__(self, model: Model, period_s: float) -> None:
        constant = np.eye(SIZE)
        for axis in range(INPUT_SIZE):
            chain = _axis_chain(model, axis, period_s)
            states = [_POSITIONS[axis], _VELOCITIES[axis], ACTUATOR + axis, DISTURBANCE + axis]
            constant[np.ix_(states, states)] = chain
        self._constant = constant
        self._forward, self._left = constant[X].copy(), constant[Y].copy()
        self._forward[X] = self._left[Y] = 0.0
        self._turn = constant[YAW].copy()
        self._turn[YAW] = 0.0

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
        jacobian = self._constant.copy()
        c, s = math.cos(start[YAW]), math.sin(start[YAW])
        jacobian[X] = c * self._forward - s * self._left
        jacobian[Y] = s * self._forward + c * self._left
        jacobian[X, X] = jacobian[Y, Y] = 1.0
        # Everything else turns with the vehicle, so a turned start turns the displacement.
        jacobian[X, YAW] = start[Y] - end[Y]
        jacobian[Y, YAW] = end[X] - start[X]
        turned = end[YAW] - start[YAW]
        c, s = math.cos(turned), math.sin(turned)
        forward, left = self._constant[XD_BODY], self._constant[YD_BODY]
        jacobian[XD_BODY] = c * forward + s * left + end[YD_BODY] * self._turn
        jacobian[YD_BODY] = c * left - s * forward - end[XD_BODY] * self._turn
        return jacobian


def _axis_chain(model: Model, axis: int, period_s: float) -> Array:
    """Exact transition of (position, velocity, actuator, disturbance) of one axis, shape (4, 4)."""
    b, k, lag_s = model.input_gain[axis], model.damping[axis], model.lag_s[axis]
    continuous = np.zeros((4, 4))
    continuous[0, 1] = 1.0
    continuous[1, 1] = k
    continuous[1, 3] = 1.0
    if lag_s > 0.0:
        continuous[1, 2] = b
        continuous[2, 2] = -1.0 / lag_s
    transition: Array = expm(period_s * continuous)
    if lag_s == 0.0:
        transition[2, 2] = 0.0
    return transition
