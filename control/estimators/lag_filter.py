"""Extended Kalman filter on model (1) with first-order lags of the actuators (docs/formulas.md).

Sixteen states: eight of the motion, four actuators, four disturbance accelerations as random walks. The
estimated disturbance is what makes the predictive controllers free of offset.
"""

from typing import Final

import numpy as np

from rcopterx.control.estimators.base import body_motion
from rcopterx.control.estimators.kalman_equations import predict_covariance, update
from rcopterx.control.estimators.linearization import (
    ACTUATOR,
    DISTURBANCE,
    MOTION,
    SIZE,
    jacobian,
    jacobian_at_rest,
)
from rcopterx.control.estimators.model_noise import model_noise
from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.interfaces import Estimate
from rcopterx.control.models.prediction import predict
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_THRUST, Array

_START_DEVIATION: Final = np.array(
    [0.001, 0.001, 0.001, 0.005, 0.3, 0.3, 0.3, 1.0, 0.03, 0.03, 0.03, 0.03, 0.3, 0.3, 0.8, 3.0]
)
POSE: Final = slice(0, INPUT_SIZE)
"""Position and yaw."""
_H: Final = np.eye(INPUT_SIZE, SIZE)


class LagFilter:
    """State x, shape (16,), and covariance P, shape (16, 16), of one vehicle."""

    def __init__(self, model: Model, settings: ExtendedKalmanSettings) -> None:
        noise = model_noise(model)
        densities = (
            [0.0] * 4,
            settings.velocity_noise or noise.velocity,
            settings.actuator_noise or noise.actuator,
            settings.disturbance_noise,
        )
        self._model = model
        self._densities = np.square(np.concatenate(densities))
        self._limit = np.array(settings.disturbance_limit or noise.disturbance_limit)
        self.x: Array = np.zeros(SIZE)
        self.x[ACTUATOR] = model.hover_input

    @property
    def estimate(self) -> Estimate:
        """The estimated motion, actuators and disturbances."""
        return Estimate(self.x[MOTION], self.x[ACTUATOR], self.x[DISTURBANCE])

    @property
    def disturbance_at_limit(self) -> bool:
        """Whether the upward disturbance has reached its limit."""
        return bool(self.x[DISTURBANCE][U_THRUST] >= self._limit[U_THRUST])

    def start(self, pose: Array, rates: Array) -> None:
        """Start at a pose with inertial velocity and yaw rate, both of shape (4,); actuators stay."""
        self.x = np.concatenate((body_motion(pose, rates), self.x[ACTUATOR], np.zeros(INPUT_SIZE)))
        self.P = np.diag(np.square(_START_DEVIATION))

    def set_pose(self, pose: Array) -> None:
        """Move the estimate to a pose, shape (4,)."""
        self._set(POSE, pose)

    def set_actuator(self, actuator: Array) -> None:
        """Replace the actuator states, shape (4,)."""
        self._set(ACTUATOR, actuator)

    def set_disturbance(self, disturbance: Array) -> None:
        """Replace the disturbance, cut to its limits, shape (4,)."""
        self._set(DISTURBANCE, np.clip(disturbance, -self._limit, self._limit))

    def _set(self, states: slice, values: Array) -> None:
        self.x = self.x.copy()  # estimates are views of it
        self.x[states] = values

    def predict(self, applied_input: Array, period_s: float) -> None:
        """Predict by one period: x = f(x, u), P = F P F' + Q."""
        before = self.estimate
        after = predict(self._model, before, applied_input, period_s)
        F = jacobian(jacobian_at_rest(self._model, period_s), before.motion, after.motion)
        self.P = predict_covariance(self.P, F, np.diag(period_s * self._densities))
        self.x = np.concatenate(after[:3])

    def correct(self, pose: Array, R: Array) -> None:
        """Correct by a pose (position and unwrapped yaw) with variances R, both of shape (4,)."""
        self.x, self.P = update(self.x, self.P, _H, R, pose - self.x[POSE])
        self.set_disturbance(self.x[DISTURBANCE])
