"""Extended Kalman filter for vehicles with a tilt model: the tilt is a state, and it is measured.

The horizontal motion is estimated by two filters side by side (`TiltFilter`), with the measured tilt and with
positions only. The second one is believed where no tilt is measured, or one that does not go with the motion
(`rcopterx.control.estimators.tilt_trust`). Height and heading, and what a first-order lag would need
to explain the flight (for controllers that know nothing else), by the filter for vehicles with lags.
"""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from rcopterx.control.estimators.lag_kalman import ExtendedKalmanSettings, LagKalmanEstimator
from rcopterx.control.estimators.linearization import ACTUATOR, DISTURBANCE, SIZE
from rcopterx.control.estimators.model_noise import model_noise
from rcopterx.control.estimators.tilt_filter import TILT_GATE, TiltFilter
from rcopterx.control.estimators.tilt_trust import TiltTrust
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.models.lateral import POSITION
from rcopterx.control.models.linear import PERIOD_DIGITS, ByPeriod
from rcopterx.native.flight import (
    AT_LIMIT,
    INDEFINITE_TILT,
    TILT_LEFT_OUT,
    TOLD,
    TRUST_CHANGED,
    UNREADABLE_TILT,
    correct_filters,
    expect_noise,
    predict_filters,
    tell,
)
from rcopterx.native.kalman import FAR, INDEFINITE, TAKEN_IN
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import YAW, Array

DISTRUSTED: Final = "tilt_distrusted"
TRUSTED_AGAIN: Final = "tilt_trusted_again"

_MOTION: Final = slice(0, ACTUATOR)
_ACTUATOR: Final = slice(ACTUATOR, DISTURBANCE)
_DISTURBANCE: Final = slice(DISTURBANCE, SIZE)
_TILT: Final = slice(TOLD, None)
_NO_TILT: Final = np.empty(0)


def tilt_filter_of(model: Model, settings: ExtendedKalmanSettings, blind: int = 0) -> TiltFilter:
    """The horizontal filter of a vehicle with a tilt model, and so many blind ones beside it."""
    noise = model_noise(model)
    return TiltFilter(
        model,
        settings.position_noise_m,
        settings.tilt_noise,
        (settings.velocity_noise or noise.velocity)[0],
        settings.tilt_density or noise.tilt,
        settings.wind_rms_m_s2,
        blind,
    )


class TiltKalmanEstimator(LagKalmanEstimator):
    """Motion, tilt, wind and trim from poses and applied inputs.

    Parameters
    ----------
    model
        The vehicle; it has a tilt model.
    period_s
        Nominal period; others are prepared when `predict` first sees them.
    settings
        Noise densities, limits and gate.

    Attributes
    ----------
    tilt_filter
        The filter of the horizontal motion, with a blind one beside it that is believed while the measured
        tilt is not trusted.
    """

    def __init__(self, model: Model, period_s: float, settings: ExtendedKalmanSettings) -> None:
        self._use_tilt = settings.measured_tilt
        self.tilt_filter = tilt_filter_of(model, settings, blind=int(self._use_tilt))
        self._measured_tilt: Array | None = None
        """Whatever it is; `_readable_tilt` is finite."""
        self._trust = TiltTrust()
        self._counted: Counter[str] = Counter()
        self._present: Estimate | None = None
        self._told_size = TOLD + self.tilt_filter.states.shape[1]
        super().__init__(model, period_s, settings)
        self._both_periods: ByPeriod[tuple[Any, ...]] = ByPeriod(self._prepared_for_both)

    def _prepared_for_both(self, period_s: float) -> tuple[Any, ...]:
        """What the prediction of a period needs to know, in the order in which `predict_filters` takes it."""
        return *self._periods[period_s], *self.tilt_filter.periods[period_s]

    @property
    def estimate(self) -> Estimate:
        """The current estimate; put together once after each change, because a control period asks often."""
        if self._present is None:
            filters, told = self.tilt_filter, np.empty(self._told_size)
            tell(self._state, filters.state, told)
            self._present = self._estimate_of(told)
        return self._present

    def _estimate_of(self, told: Array) -> Estimate:
        """Estimate from what `rcopterx.native.flight.tell` tells."""
        tilt = self.tilt_filter.estimate_of(told[_TILT])
        return Estimate(told[_MOTION], told[_ACTUATOR], told[_DISTURBANCE], tilt)

    @property
    def events(self) -> Mapping[str, int]:
        """How often a measured tilt was distrusted, and trusted again."""
        return self._counted

    def reset(self, measurement: Measurement) -> None:
        """Start at rest at a measured pose (`PoseEstimator.reset`)."""
        self._measured_tilt = measurement.tilt if self._use_tilt else None
        super().reset(measurement)

    def correct(self, measurement: Measurement) -> bool:
        """Take in a pose (`PoseEstimator.correct`)."""
        self._measured_tilt = measurement.tilt if self._use_tilt else None
        self._present = None
        return super().correct(measurement)

    def take_over(self, estimate: Estimate) -> None:
        """Start from another estimator's estimate, tilt and disturbance included."""
        self._measured_tilt = None
        super().take_over(estimate)
        if estimate.has_tilt:
            self.tilt_filter.take_over(estimate.tilt)

    def position_deviation_m(self) -> Array:
        """See `TellsUncertainty`."""
        deviation = super().position_deviation_m()
        deviation[POSITION] = np.sqrt(self.tilt_filter.covariance.diagonal()[POSITION])
        return deviation

    @property
    def _readable_tilt(self) -> Array | None:
        """The measured tilt if it is one."""
        tilt = self._measured_tilt
        return tilt if tilt is not None and all(map(math.isfinite, tilt.tolist())) else None

    @property
    def _trusted_tilt(self) -> Array | None:
        """The measured tilt if it is to be taken in."""
        return self._readable_tilt if self._trust.trusted else None

    def _settle(self, applied_input: Array) -> None:
        super()._settle(applied_input)
        self.tilt_filter.settle(applied_input[:2])

    def _start(self, pose: Array, rates: Array) -> None:
        self._present = None
        super()._start(pose, rates)
        self._trust.forget()
        if self.standing:
            self.tilt_filter.stand(pose[:2], self._trusted_tilt, float(pose[YAW]))
        else:
            self.tilt_filter.start(pose[:2], rates[:2], self._trusted_tilt, float(pose[YAW]))

    def _move(self, applied_input: Array, period_s: float) -> None:
        self._present = None
        filters = self.tilt_filter
        if self._standing:
            super()._move(applied_input, period_s)
            filters.rest(applied_input[:2], period_s)
            return
        self._since_pose_s += period_s
        predict_filters(
            self._state,
            self._covariance,
            filters.states,
            filters.covariances,
            applied_input,
            *self._both_periods[round(period_s, PERIOD_DIGITS)],
        )

    def _predicted_pose(self) -> Array:
        pose = super()._predicted_pose()
        pose[:2] = self.tilt_filter.position_m
        return pose

    def _correct(self, position_m: Array, yaw_rad: float, near: Array) -> bool:
        told, tilt = np.empty(self._told_size), self._measured_tilt
        outcome = self._correct_filters(position_m, yaw_rad, _NO_TILT if tilt is None else tilt, near, told)
        if outcome == TAKEN_IN:
            self._since_pose_s = 0.0
            self._present = self._estimate_of(told)
            return True
        if outcome == UNREADABLE_TILT:
            self._measured_tilt = None
            return self._correct(position_m, yaw_rad, near)
        return outcome != FAR and self._go_on_after(outcome)

    def _correct_filters(
        self, position_m: Array, yaw_rad: float, tilt: Array, near: Array, told: Array
    ) -> int:
        filters, trust = self.tilt_filter, self._trust
        return correct_filters(
            self._state,
            self._covariance,
            filters.states,
            filters.covariances,
            filters.believed,
            position_m,
            yaw_rad,
            tilt,
            near,
            self._noise.memory,
            self._since_pose_s,
            self._least_noise,
            self._measurement_variance,
            self._limit,
            self._pose,
            trust.memory,
            trust.noise_memory,
            filters.least_noise,
            filters.noise_variances,
            filters.tilted,
            filters.state_limit,
            TILT_GATE,
            told,
        )

    def _go_on_after(self, outcome: int) -> bool:
        """Take in what of a pose was left after something that is not usual."""
        if outcome in (INDEFINITE, INDEFINITE_TILT):
            raise np.linalg.LinAlgError("the covariance of a filter is not positive definite")
        since_pose_s, self._since_pose_s = self._since_pose_s, 0.0
        if outcome == TILT_LEFT_OUT:
            self.tilt_filter.tilts_left_out += 1
            return True
        if outcome == AT_LIMIT:
            self._stand_if_pushed()
        tilt, yaw_rad, changed = self._readable_tilt, float(self._pose[YAW]), outcome == TRUST_CHANGED
        if outcome == AT_LIMIT and tilt is not None:
            changed = self._trust.observe(tilt, self.tilt_filter.expected_tilt, yaw_rad, since_pose_s)
        if changed:
            self._change_trust()
        self._expect_noise()
        self.tilt_filter.correct(self._pose, self._trusted_tilt, yaw_rad)
        return True

    def _stay(self, pose: Array) -> None:
        tilt = self._readable_tilt
        if tilt is not None:
            self._trust.observe_noise(tilt, self._since_pose_s)
        super()._stay(pose)
        self._expect_noise()
        self.tilt_filter.stand(pose[:2], self._trusted_tilt, float(pose[YAW]))

    def _expect_noise(self) -> None:
        """Tell the horizontal filter what noise its measurements have."""
        filters = self.tilt_filter
        expect_noise(
            self._measurement_variance, self._trust.memory, filters.least_noise, filters.noise_variances
        )

    def _change_trust(self) -> None:
        """Go on with the measured tilt, or without it."""
        if self._trust.trusted:
            self._counted[TRUSTED_AGAIN] += 1
        else:
            self._counted[DISTRUSTED] += 1
            self.tilt_filter.forget_offset()
        self.tilt_filter.believe(0 if self._trust.trusted else 1)
