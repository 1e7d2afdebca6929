"""A controller of one's own: acceleration feedback with preview, and a plan that others can follow."""

import numpy as np

from rcopterx.control.controllers.base import BaseController
from rcopterx.control.controllers.settings import ControllerSettings, PositiveFloat
from rcopterx.control.interfaces import ControlStep
from rcopterx.control.models.roll_out import predict
from rcopterx.vehicles.state import U_THRUST, heading_matrix


class Settings(ControllerSettings, frozen=True, kw_only=True):
    """What a fleet file may set, beside the horizon and the limits."""

    stiffness: PositiveFloat = 6.0
    damping: PositiveFloat = 4.0


class Backstepping(BaseController):
    """Desired acceleration from position and velocity errors, turned into inputs by the model."""

    Settings = Settings

    def __init__(self, model, period_s, settings):
        super().__init__(model, period_s, settings.horizon, settings.limits(model))
        self._settings = settings

    def _start(self, estimate, last_input):
        """Nothing to remember: this law has no integrators."""

    def _compute(self, estimate, reference):
        wanted = reference.samples[0]
        to_body = np.eye(4)
        to_body[:2, :2] = heading_matrix(estimate.motion[3]).T
        position_error = to_body @ (wanted[:4] - estimate.motion[:4])
        velocity_error = to_body @ wanted[4:8] - estimate.motion[4:]
        acceleration = to_body @ wanted[8:12] - estimate.disturbance
        acceleration += self._settings.stiffness * position_error + self._settings.damping * velocity_error
        acceleration[U_THRUST] += self._model.gravity_m_s2
        first = (acceleration - self._model.k * estimate.motion[4:]) / self._model.b
        inputs = np.tile(self._model.hover_input, (self._horizon - 1, 1))
        inputs[0] = np.clip(first, self._limits.input_min, self._limits.input_max)
        return ControlStep(inputs, predict(self._model, estimate, inputs, self._period_s), None, 0)
