"""PID with velocity damping: the controller that needs no model but its gains."""

import numpy as np

from rcopterx.control.controllers.feedback import FeedbackController
from rcopterx.control.controllers.settings import ControllerSettings, FourWeights, PositiveFloat
from rcopterx.vehicles.model import Model


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

    Raises `SettingsError`: bounds that the vehicle cannot have.
    """

    Settings = PidSettings

    def __init__(self, model: Model, period_s: float, settings: PidSettings) -> None:
        gain = np.hstack((np.diag(settings.proportional), np.diag(settings.damping))) / model.b[:, None]
        error_cap = [*3 * [settings.error_limit_m], settings.yaw_error_limit_rad, *4 * [np.inf]]
        integral_gain = np.array(settings.integral) / model.b[:3]
        super().__init__(model, period_s, settings, gain, integral_gain, np.array(error_cap))
