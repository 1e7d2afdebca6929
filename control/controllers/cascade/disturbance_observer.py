"""Integral action for estimators that tell no disturbance.

What moves the vehicle away from its own plan is integrated, as the constant acceleration that explains it;
the prediction knows that acceleration just as it knows an estimated disturbance. It takes the place of the
integral states of equation (1): there is nothing to wind up, because a moved set point moves the plan too.
"""

from typing import Final

import numpy as np

from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, XD_BODY, YAW, Array, heading_matrix

TIME_CONSTANT_S: Final = 1.0
ACCELERATION_CAP: Final = np.array([0.6, 0.6, 1.5])
"""Largest acceleration that is believed to be a disturbance, x, y, z [m/s^2]."""


class DisturbanceObserver:
    """Constant inertial acceleration learnt from departures from the plan.

    Parameters
    ----------
    model
        The vehicle.
    period_s
        Control period.
    """

    def __init__(self, model: Model, period_s: float) -> None:
        self._model, self._period_s = model, period_s
        self._acceleration = np.zeros(3)

    def start(self, motion: Array, last_input: Array) -> None:
        """Take the last input for the trim that balances the disturbance, which makes a switch bumpless."""
        body = -self._model.b[:3] * (last_input - self._model.hover_input)[:3]
        body[:2] = heading_matrix(motion[YAW]) @ body[:2]
        self._acceleration = np.clip(body, -ACCELERATION_CAP, ACCELERATION_CAP)

    def observe(self, motion: Array, previous_plan: Trajectory) -> None:
        """Compare the velocity with what the previous step's plan had for this instant."""
        velocity = motion[XD_BODY : XD_BODY + 3].copy()
        velocity[:2] = heading_matrix(motion[YAW] + 0.5 * self._period_s * motion[-1]) @ velocity[:2]
        surprise = (velocity - previous_plan.velocity_m_s[1]) / self._period_s
        self._acceleration += self._period_s / TIME_CONSTANT_S * surprise
        np.clip(self._acceleration, -ACCELERATION_CAP, ACCELERATION_CAP, out=self._acceleration)

    def disturbance(self, motion: Array) -> Array:
        """Learnt disturbance in the order of `Estimate.disturbance`, shape (4,)."""
        disturbance = np.zeros(INPUT_SIZE)
        disturbance[:2] = heading_matrix(motion[YAW]).T @ self._acceleration[:2]
        disturbance[2] = self._acceleration[2]
        return disturbance
