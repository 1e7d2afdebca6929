"""Finite difference and low-pass: the simplest estimator, kept for comparison."""

import math
from typing import Final

import numpy as np

from rcopterx.control.estimators.base import PoseEstimator
from rcopterx.control.estimators.settings import EstimatorSettings, Positive
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.models.prediction import actuator_response
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, YAW, Array, body_motion

_UNKNOWN_ACCELERATION: Final = np.array([0.5, 0.5, 1.0, 3.0])
"""Deviation of accelerations, which this estimator does not know [m/s^2, rad/s^2]."""
_VELOCITY_AGE_S: Final = 0.2  # twice the delay of the smoothed velocity


class FiniteDifferenceSettings(EstimatorSettings, frozen=True, kw_only=True):
    """Settings of the finite difference estimator."""

    cutoff_hz: Positive = 4.0
    """Corner frequency of the first-order low-pass on velocities and yaw rate."""


class FiniteDifferenceEstimator(PoseEstimator):
    """Pose as measured, velocity from smoothed differences; `ValueError` for a cut-off above Nyquist."""

    Settings = FiniteDifferenceSettings

    def __init__(self, model: Model, period_s: float, settings: FiniteDifferenceSettings) -> None:
        super().__init__(model, settings)
        if settings.cutoff_hz > 0.5 / period_s:
            raise ValueError(
                f"cutoff_hz: {settings.cutoff_hz} is above half the pose rate, {0.5 / period_s:g} Hz"
            )
        self._cutoff_rad_s = math.tau * settings.cutoff_hz
        self._actuator = model.hover_input
        self._start(np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE))

    @property
    def estimate(self) -> Estimate:
        """The current estimate, with zero disturbance."""
        return Estimate(body_motion(self._pose, self._rates), self._actuator, np.zeros(INPUT_SIZE))

    def _set_actuators(self, applied_input: Array) -> None:
        self._actuator = applied_input.astype(float)

    def _start(self, pose: Array, rates: Array) -> None:
        self._pose = self._measured = pose
        self._rates = rates
        self._elapsed_s = 0.0

    def _move(self, offset: Array) -> None:
        self._pose, self._measured = self._pose + offset, self._measured + offset

    def predict(self, applied_input: Array, period_s: float) -> None:
        """Predict by one period (`PoseEstimator.predict`)."""
        self._begin(applied_input, period_s)
        self._actuator = actuator_response(
            self._model, self._actuator, applied_input, float(self._rates[YAW]), period_s
        )
        self._pose = self._pose + period_s * self._rates
        self._elapsed_s += period_s

    def correct(self, measurement: Measurement) -> bool:
        """Correct the estimate by a pose (`PoseEstimator.correct`)."""
        deviation = 0.5 * self._elapsed_s * (self._elapsed_s + _VELOCITY_AGE_S) * _UNKNOWN_ACCELERATION
        accepted, pose = self._accept(measurement, self._pose, deviation)
        if pose is None:
            return accepted
        if self._elapsed_s > 0.0:
            renewal = -math.expm1(-self._cutoff_rad_s * self._elapsed_s)
            difference = (pose - self._measured) / self._elapsed_s
            self._rates = self._rates + renewal * (difference - self._rates)
        self._pose = self._measured = pose
        self._elapsed_s = 0.0
        return accepted
