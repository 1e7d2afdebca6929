"""The state feedback of the product with the gains of a linear-quadratic regulator."""

import numpy as np

from rcopterx.control.controllers.feedback import FeedbackController
from rcopterx.control.controllers.settings import ControllerSettings, FourWeights, PositiveFloat
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import MOTION_SIZE
from rcopterx_studies.baselines.paper_model import (
    INPUT_WEIGHTS,
    INTEGRAL_STATES,
    STATE_WEIGHTS,
    ElevenWeights,
    PaperModel,
    TerminalCost,
)


class LqrSettings(ControllerSettings, frozen=True, kw_only=True):
    """Settings of the regulator."""

    state_weights: ElevenWeights = STATE_WEIGHTS
    """Diagonal of Q: x y z psi xd_B yd_B zd_B psid x_int y_int z_int; x and y along the body axes."""
    input_weights: FourWeights = INPUT_WEIGHTS
    """Diagonal of R: pitch, roll, thrust, yaw."""
    error_limit_m: PositiveFloat = 0.5
    """Position errors count up to this, which bounds the speed of long moves."""


class LqrController(FeedbackController):
    """Infinite-horizon regulator of equation (2), gains turned with the heading; raises `SettingsError`."""

    Settings = LqrSettings

    def __init__(self, model: Model, period_s: float, settings: LqrSettings) -> None:
        paper_model = PaperModel(model, period_s)
        cost = TerminalCost(paper_model, np.array(settings.state_weights), np.array(settings.input_weights))
        gain = cost.gain(0.0)
        integral_gain = np.diag(gain[:3, INTEGRAL_STATES]) * paper_model.integrator_gains
        error_cap = np.full(MOTION_SIZE, np.inf)
        error_cap[:3] = settings.error_limit_m
        super().__init__(model, period_s, settings, gain[:, :MOTION_SIZE], integral_gain, error_cap)
