"""Integral action for estimators that estimate no disturbance.

Departures from the plan are integrated as the constant acceleration that explains them, which the prediction
then contains like an estimated disturbance. It replaces the integral states of equation (1) and cannot wind
up, because a moved set point moves the plan too.
"""

from typing import Final

import numpy as np

from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import XD_BODY, YAW, Array, turned_about_z

TIME_CONSTANT_S: Final = 1.0
ACCELERATION_CAP: Final = np.array([0.6, 0.6, 1.5])
"""Largest disturbance, x, y, z [m/s^2]."""


class DisturbanceObserver:
    """Constant inertial acceleration from departures from the plan."""

    def __init__(self, model: Model, period_s: float) -> None:
        self._model, self._period_s = model, period_s
        self._acceleration = np.zeros(3)

    def start(self, motion: Array, last_input: Array) -> None:
        """Start from the disturbance that the last input balances, which makes a switch bumpless."""
        body = -self._model.b[:3] * (last_input - self._model.hover_input)[:3]
        self._acceleration = np.clip(turned_about_z(body, motion[YAW]), -ACCELERATION_CAP, ACCELERATION_CAP)

    def observe(self, motion: Array, previous_plan: Trajectory) -> None:
        """Compare the velocity with what the previous step's plan had for this instant."""
        middle_rad = motion[YAW] + 0.5 * self._period_s * motion[-1]
        velocity = turned_about_z(motion[XD_BODY : XD_BODY + 3], middle_rad)
        surprise = (velocity - previous_plan.velocity_m_s[1]) / self._period_s
        self._acceleration += self._period_s / TIME_CONSTANT_S * surprise
        np.clip(self._acceleration, -ACCELERATION_CAP, ACCELERATION_CAP, out=self._acceleration)

    def disturbance(self, motion: Array) -> Array:
        """Return the disturbance in the order of `Estimate.disturbance`, shape (4,)."""
        return np.append(turned_about_z(self._acceleration, -motion[YAW]), 0.0)
