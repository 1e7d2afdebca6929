"""Extended Kalman filter for vehicles with a tilt model: the tilt is a state, and it is measured.

The horizontal motion is estimated by two filters side by side (`TiltFilter`), with the measured tilt and with
positions only. The second one is believed where no tilt is measured, or one that does not go with the motion
(`rcopterx.agents.estimators.tilt_trust`). Height and heading, and what a first-order lag would need
to explain the flight (for controllers that know nothing else), by the filter for vehicles with lags.
"""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Final

import numpy as np

from rcopterx.agents.estimators.lag_kalman import ExtendedKalmanSettings, LagKalmanEstimator
from rcopterx.agents.estimators.linearization import ACTUATOR, DISTURBANCE
from rcopterx.agents.estimators.model_noise import model_noise
from rcopterx.agents.estimators.tilt_filter import TiltFilter
from rcopterx.agents.estimators.tilt_trust import TiltTrust
from rcopterx.agents.flight.lateral import POSITION
from rcopterx.agents.interfaces import Estimate, Measurement
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import YAW, Array

DISTRUSTED: Final = "tilt_distrusted"
TRUSTED_AGAIN: Final = "tilt_trusted_again"


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
        self._trust = TiltTrust()
        self._counted: Counter[str] = Counter()
        self._present: Estimate | None = None
        super().__init__(model, period_s, settings)

    @property
    def estimate(self) -> Estimate:
        """The current estimate; put together once after each change, because a control period asks often."""
        if self._present is None:
            # Plain floats: arrays of two take longer than the arithmetic on them.
            x, y, vx, vy = self.tilt_filter.horizontal.tolist()
            state = self._state.copy()
            _, _, z, yaw, _, _, zd, yaw_rate = self._motion.tolist()
            c, s = math.cos(yaw), math.sin(yaw)
            motion = np.array((x, y, z, yaw, c * vx + s * vy, c * vy - s * vx, zd, yaw_rate))
            actuator, disturbance = state[ACTUATOR:DISTURBANCE], state[DISTURBANCE:]
            self._present = Estimate(motion, actuator, disturbance, self.tilt_filter.estimate)
        return self._present

    @property
    def events(self) -> Mapping[str, int]:
        """How often a measured tilt was distrusted, and trusted again."""
        return self._counted

    def reset(self, measurement: Measurement) -> None:
        """Start at rest at a measured pose (`PoseEstimator.reset`)."""
        self._measured_tilt = self._tilt_of(measurement)
        super().reset(measurement)

    def correct(self, measurement: Measurement) -> bool:
        """Take in a pose (`PoseEstimator.correct`)."""
        self._measured_tilt = self._tilt_of(measurement)
        self._present = None
        return super().correct(measurement)

    def take_over(self, estimate: Estimate) -> None:
        """Start from another estimator's estimate, tilt and disturbance included."""
        self._measured_tilt = None
        super().take_over(estimate)
        if estimate.tilt is not None:
            self.tilt_filter.take_over(estimate.tilt)

    def position_deviation_m(self) -> Array:
        """See `TellsUncertainty`."""
        deviation = super().position_deviation_m()
        deviation[POSITION] = np.sqrt(self.tilt_filter.covariance.diagonal()[POSITION])
        return deviation

    @property
    def _trusted_tilt(self) -> Array | None:
        """The measured tilt if it is to be taken in."""
        return self._measured_tilt if self._trust.trusted else None

    def _tilt_of(self, measurement: Measurement) -> Array | None:
        tilt = measurement.tilt if self._use_tilt else None
        return tilt if tilt is not None and all(map(math.isfinite, tilt.tolist())) else None

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
        standing, middle_rad = self._standing, self._advance(applied_input, period_s)
        if standing:
            self.tilt_filter.rest(applied_input[:2], period_s)
        else:
            self.tilt_filter.predict(applied_input, middle_rad, period_s)

    def _predicted_pose(self) -> Array:
        pose = super()._predicted_pose()
        pose[:2] = self.tilt_filter.position_m
        return pose

    def _expected_m(self) -> Array:
        return self.tilt_filter.state

    def _correct(self, position_m: Array, yaw_rad: float, near: Array) -> bool:
        since_pose_s = self._since_pose_s
        if not super()._correct(position_m, yaw_rad, near):
            return False
        yaw_rad = float(self._pose[YAW])
        if self._measured_tilt is not None:
            expected = self.tilt_filter.expected_tilt
            if self._trust.observe(self._measured_tilt, expected, yaw_rad, since_pose_s):
                self._change_trust()
        self._expect_noise()
        self.tilt_filter.correct(self._pose, self._trusted_tilt, yaw_rad)
        return True

    def _stay(self, pose: Array) -> None:
        if self._measured_tilt is not None:
            self._trust.observe_noise(self._measured_tilt, self._since_pose_s)
        super()._stay(pose)
        self._expect_noise()
        self.tilt_filter.stand(pose[:2], self._trusted_tilt, float(pose[YAW]))

    def _expect_noise(self) -> None:
        """Tell the horizontal filter what noise its measurements have."""
        self.tilt_filter.expect_noise(math.sqrt(self._measurement_variance[0]), self._trust.noise)

    def _change_trust(self) -> None:
        """Go on with the measured tilt, or without it."""
        if self._trust.trusted:
            self._counted[TRUSTED_AGAIN] += 1
        else:
            self._counted[DISTRUSTED] += 1
            self.tilt_filter.forget_offset()
        self.tilt_filter.believe(0 if self._trust.trusted else 1)
