"""State feedback with integral action, and PID gains for it; its plan is the closed loop of law and model.

Errors are turned into the body frame, so one set of gains serves every heading; the plan lets other vehicles
follow one that is flown by simple feedback.
"""

from collections.abc import Callable
from typing import Final

import numpy as np

from rcopterx.control.controllers.base import BaseController
from rcopterx.control.controllers.settings import ControllerSettings, FourWeights, PositiveFloat
from rcopterx.control.interfaces import ControlStep, Estimate
from rcopterx.control.models.prediction import behind_gyro, derivative
from rcopterx.control.models.roll_out import lag_poles, predict
from rcopterx.control.references.columns import X_RATE
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import MOTION_SIZE, XD_BODY, YAW, YAW_RATE, Array, heading_matrix, turned_about_z

TRIM_CAP: Final = np.array([0.2, 0.2, 0.15])  # further from hovering an input is a manoeuvre and no trim


class FeedbackController(BaseController):
    """Control law u = u_hover + trim - K error; the trim integrates errors of the position.

    `gain`: K, shape (4, 8); an error is motion state minus reference: position (body frame), yaw, body
    velocity, yaw rate. `integral_gain`: change of the pitch, roll and thrust trim [1/s] against an error of
    the position, shape (3,). `error_cap`: errors count up to this, shape (8,).
    """

    def __init__(
        self,
        model: Model,
        period_s: float,
        settings: ControllerSettings,
        gain: Array,
        integral_gain: Array,
        error_cap: Array,
    ) -> None:
        super().__init__(model, period_s, settings.horizon, settings.limits(model))
        self._gain, self._integral_gain, self._error_cap = gain, integral_gain, error_cap
        self._pole = lag_poles(model, period_s)
        self._trim = np.zeros(3)

    def _start(self, estimate: Estimate, last_input: Array) -> None:
        trim = np.clip((last_input - self._model.hover_input)[:3], -TRIM_CAP, TRIM_CAP)
        self._trim = turned_about_z(trim, float(estimate.motion[YAW]))

    def _compute(
        self,
        estimate: Estimate,
        reference: Trajectory,
        expired: Callable[[], bool],  # noqa: ARG002 - this law is fast
    ) -> ControlStep:
        inputs = self._closed_loop(estimate, reference)
        self._trim = self._integrated(self._trim, estimate.motion, reference.samples[0], inputs[0])
        return ControlStep(inputs, predict(self._model, estimate, inputs, self.period_s), None, 0)

    def _closed_loop(self, estimate: Estimate, reference: Trajectory) -> Array:
        """Inputs of law and model over the horizon, shape (N - 1, 4)."""
        model, motion, actuator = self._model.motion_model, estimate.motion, estimate.actuator
        trim = self._trim
        inputs = np.empty((self.horizon - 1, 4))
        for command, sample in zip(inputs, reference.samples, strict=False):
            command[:] = self._law(motion, sample, trim)
            trim = self._integrated(trim, motion, sample, command)
            rates = derivative(model, motion, actuator, estimate.disturbance)
            followed = behind_gyro(model, command, actuator, motion[YAW_RATE])
            actuator = self._pole * actuator + (1.0 - self._pole) * followed
            motion = motion + self.period_s * rates
        return inputs

    def _law(self, motion: Array, sample: Array, trim: Array) -> Array:
        command = self._model.hover_input - self._gain @ self._error(motion, sample)
        command[:3] += turned_about_z(trim, -float(motion[YAW]))
        return np.clip(command, self._limits.input_min, self._limits.input_max)

    def _integrated(self, trim: Array, motion: Array, sample: Array, command: Array) -> Array:
        """Trim one period later; an input at its limit integrates no further into it (anti-windup)."""
        rate = -self._integral_gain * self._error(motion, sample)[:3]
        low = (command <= self._limits.input_min)[:3] & (rate < 0)
        high = (command >= self._limits.input_max)[:3] & (rate > 0)
        rate[low | high] = 0.0
        moved = trim + self.period_s * turned_about_z(rate, float(motion[YAW]))
        return np.asarray(np.clip(moved, -TRIM_CAP, TRIM_CAP))

    def _error(self, motion: Array, sample: Array) -> Array:
        to_body = heading_matrix(float(motion[YAW])).T
        error = motion - sample[:MOTION_SIZE]
        error[:2] = to_body @ error[:2]
        error[XD_BODY : XD_BODY + 2] = motion[XD_BODY : XD_BODY + 2] - to_body @ sample[X_RATE : X_RATE + 2]
        return np.clip(error, -self._error_cap, self._error_cap)


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
    """PID in the body frame of the present heading; the model serves the plan. Raises `SettingsError`."""

    Settings = PidSettings

    def __init__(self, model: Model, period_s: float, settings: PidSettings) -> None:
        gain = np.hstack((np.diag(settings.proportional), np.diag(settings.damping))) / model.b[:, None]
        error_cap = [*3 * [settings.error_limit_m], settings.yaw_error_limit_rad, *4 * [np.inf]]
        integral_gain = np.array(settings.integral) / model.b[:3]
        super().__init__(model, period_s, settings, gain, integral_gain, np.array(error_cap))
