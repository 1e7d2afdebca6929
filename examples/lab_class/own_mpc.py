"""Second afternoon: model predictive control of one's own.

Every axis is a mass point that the planned accelerations of the horizon move along the reference. Write
`weights`, and replace the law behind `_first_steps` by a problem with bounds.
"""

import numpy as np

from rcopterx.control.controllers.base import BaseController
from rcopterx.control.controllers.settings import ControllerSettings
from rcopterx.control.interfaces import ControlStep
from rcopterx.control.models.roll_out import predict
from rcopterx.vehicles.state import turned_about_z


def weights(axis):
    """Weights of position, velocity and acceleration for x, y, z, yaw. Your answer; these are too soft."""
    return 2.0, 1.5, 0.8


class OwnMpc(BaseController):
    """Unconstrained MPC of four double integrators."""

    Settings = ControllerSettings

    def __init__(self, model, period_s, settings):
        super().__init__(model, period_s, settings.horizon, settings.limits(model))
        stages = settings.horizon - 1
        ahead = np.arange(stages)[:, None] - np.arange(stages)
        past = ahead >= 0
        # Velocities and positions after each stage by the accelerations up to it.
        self._to_velocity = period_s * past
        self._to_position = period_s**2 * (ahead + 0.5) * past
        self._laws = [self._law(*weights(axis)) for axis in range(4)]

    def _law(self, position, velocity, acceleration):
        """Accelerations of the least squares problem as a matrix times the errors without them."""
        rows = np.vstack((position * self._to_position, velocity * self._to_velocity))
        problem = np.vstack((rows, acceleration * np.eye(rows.shape[1])))
        solution = np.linalg.pinv(problem)[:, : len(rows)]
        return solution * np.repeat((position, velocity), rows.shape[1])

    def _start(self, estimate, last_input):
        """Nothing to set."""

    def _compute(self, estimate, reference, expired):
        inputs = np.tile(self._model.hover_input, (self.horizon - 1, 1))
        accelerations = self._first_steps(estimate, reference)
        for row, wanted in zip(inputs, accelerations, strict=True):
            body = turned_about_z(wanted, -float(estimate.motion[3]))
            # Disturbances of x and y change too fast for a law that does not model the lag of the tilt.
            body[2:] -= estimate.disturbance[2:]
            row += body / self._model.b
        low, high = self._limits.input_min, self._limits.input_max
        inputs = np.clip(inputs, low, high)
        return ControlStep(inputs, predict(self._model, estimate, inputs, self.period_s), None, 0)

    def _first_steps(self, estimate, reference):
        """Accelerations of all stages, inertial frame, shape (N - 1, 4)."""
        motion, samples = estimate.motion, reference.samples[1:]
        velocity = turned_about_z(motion[4:], float(motion[3]))
        times_s = self.period_s * np.arange(1, self.horizon)[:, None]
        errors = samples[:, :4] - motion[:4] - times_s * velocity, samples[:, 4:8] - velocity
        together = np.concatenate(errors)
        return np.transpose([law @ together[:, axis] for axis, law in enumerate(self._laws)])
