"""The horizontal motion of a vehicle with a tilt model, as one linear system in the inertial frame.

    state   position, velocity, core (`rcopterx.vehicles.tilt`), servo [m/s^2], wind      two components each
    input   demand e = R(psi) b (stick + trim)                                   [m/s^2]

Nothing in it depends on the heading except the direction of the demand, so its matrices are computed once.
The drag is the mean of the two body axes; the servo's state turns with the body, which is neglected where a
prediction covers more than one period.
"""

import math
from functools import cached_property
from typing import Final

import numpy as np

from rcopterx.control.models.linear import cached_by_period, zero_order_hold
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array, heading_matrix

POSITION: Final = slice(0, 2)
VELOCITY: Final = slice(2, 4)
CORE_FROM: Final = 4
WIND_CORRELATION_S: Final = 0.5
"""Correlation time of the wind's acceleration."""


class LateralSystem:
    """Continuous dynamics, and discrete matrices for one period during which the demand is constant.

    Attributes
    ----------
    continuous, continuous_demand
        x' = continuous x + continuous_demand e, shapes (n, n) and (n, 2).
    acceleration
        Acceleration = acceleration x, wind included, shape (2, n); a demand acts through the servo only.
    core, tilt, tilt_rate, servo, wind
        Places of these states; tilt and tilt rate are part of the core.

    Raises
    ------
    ValueError
        The model has no tilt model.
    """

    def __init__(self, model: Model, period_s: float) -> None:
        if model.tilt is None:
            raise ValueError(f"{model.kind}: a first-order lag has no tilt to predict")
        dynamics = model.tilt.dynamics()
        self.core = slice(CORE_FROM, CORE_FROM + dynamics.size)
        self.tilt = slice(CORE_FROM, CORE_FROM + 2)
        self.tilt_rate = slice(CORE_FROM + dynamics.rate.start, CORE_FROM + dynamics.rate.stop)
        self.servo = slice(self.core.stop, self.core.stop + 2)
        self.wind = slice(self.servo.stop, self.servo.stop + 2)
        self.size = self.wind.stop
        self.period_s = period_s
        self.acceleration: Array = np.zeros((2, self.size))
        self.acceleration[:, VELOCITY] = 0.5 * sum(model.damping[:2]) * np.eye(2)
        self.acceleration[:, self.core] = dynamics.c
        self.acceleration[:, self.servo] = dynamics.d
        self.acceleration[:, self.wind] = np.eye(2)
        self.continuous: Array = np.zeros((self.size, self.size))
        self.continuous[POSITION, VELOCITY] = np.eye(2)
        self.continuous[VELOCITY] = self.acceleration
        self.continuous[self.core, self.core] = dynamics.a
        self.continuous[self.core, self.servo] = dynamics.b
        self.continuous[self.servo, self.servo] = -np.eye(2) / model.tilt.servo_lag_s
        self.continuous[self.wind, self.wind] = -np.eye(2) / WIND_CORRELATION_S
        self.continuous_demand: Array = np.zeros((self.size, 2))
        self.continuous_demand[self.servo] = np.eye(2) / model.tilt.servo_lag_s
        self.servo_pole = math.exp(-period_s / model.tilt.servo_lag_s)

    @property
    def transition(self) -> Array:
        """State after a period by the state before it, F, shape (n, n)."""
        return self._step[0]

    @property
    def demand(self) -> Array:
        """State after a period by the demand, G, shape (n, 2)."""
        return self._step[1]

    @cached_property
    def _step(self) -> tuple[Array, Array]:
        return zero_order_hold(self.continuous, self.continuous_demand, self.period_s)


@cached_by_period
def lateral_system(model: Model, period_s: float) -> LateralSystem:
    """Return the system of a model and a period, from a cache."""
    return LateralSystem(model, period_s)


def demand_matrix(model: Model, yaw_rad: float) -> Array:
    """Return R(psi) b: demand [m/s^2] per pitch and roll stick, shape (2, 2)."""
    return np.asarray(heading_matrix(yaw_rad) * model.b[:2])
