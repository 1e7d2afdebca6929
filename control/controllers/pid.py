"""PID with velocity damping: the controller that needs no model but its gains."""

import numpy as np

from rcopterx.control.controllers.feedback import FeedbackController
from rcopterx.control.controllers.settings import ControllerSettings, FourWeights, PositiveFloat
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import XD_BODY, Array


class PidSettings(ControllerSettings, frozen=True, kw_only=True):
    """Gains as accelerations, so that they mean the same on every vehicle; x, y (body), z, yaw."""

    proportional: FourWeights = (2.5, 2.5, 6.0, 12.0)
    """Acceleration per error [1/s^2]."""
    damping: FourWeights = (2.8, 2.8, 4.5, 7.0)
    """Acceleration per velocity error [1/s]."""
    integral: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = (0.6, 0.6, 2.0)
    """Acceleration per integrated position error [1/s^3]."""
    error_limit_m: PositiveFloat = 0.5
    """Position errors count up to this, which bounds the speed of long moves."""
    yaw_error_limit_rad: PositiveFloat = 1.2
    """Heading errors count up to this."""


class PidController(FeedbackController):
    """PID in the body frame of the present heading; the model serves the plan alone.

    Raises
    ------
    SettingsError
        Bounds that the vehicle cannot have.
    """

    Settings = PidSettings

    def __init__(self, model: Model, period_s: float, settings: PidSettings) -> None:
        super().__init__(model, period_s, settings.horizon, settings.limits(model))
        self._proportional = np.array(settings.proportional) / model.b
        self._damping = np.array(settings.damping) / model.b
        self._integral = np.array(settings.integral) / model.b[:3]
        self._cap = np.array([*(3 * [settings.error_limit_m]), settings.yaw_error_limit_rad])

    def _feedback(self, error: Array) -> Array:
        limited = np.clip(error[:XD_BODY], -self._cap, self._cap)
        return np.asarray(self._proportional * limited + self._damping * error[XD_BODY:])

    def _trim_rate(self, error_m: Array) -> Array:
        return np.asarray(-self._integral * np.clip(error_m, -self._cap[:3], self._cap[:3]))
