"""Extended Kalman filter for vehicles with a tilt model: the tilt is a state, and it is measured.

The horizontal motion is estimated by two filters side by side, `TiltFilter` with the measured tilt and with
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
from rcopterx.agents.estimators.model_noise import model_noise
from rcopterx.agents.estimators.noise_meter import NoiseMeter
from rcopterx.agents.estimators.tilt_filter import TiltFilter
from rcopterx.agents.estimators.tilt_trust import TiltTrust
from rcopterx.agents.flight.lateral import POSITION
from rcopterx.agents.interfaces import Estimate, Measurement
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, YAW, YAW_RATE, Array

DISTRUSTED: Final = "tilt_distrusted"
TRUSTED_AGAIN: Final = "tilt_trusted_again"

_NO_NOISE: Final = (0.0, 0.0)


def tilt_filter_of(model: Model, settings: ExtendedKalmanSettings) -> TiltFilter:
    """The horizontal filter of a vehicle with a tilt model."""
    noise = model_noise(model)
    return TiltFilter(
        model,
        settings.position_noise_m,
        settings.tilt_noise,
        (settings.velocity_noise or noise.velocity)[0],
        settings.tilt_density or noise.tilt,
        settings.wind_rms_m_s2,
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
    """

    def __init__(self, model: Model, period_s: float, settings: ExtendedKalmanSettings) -> None:
        self._with_tilt, self._positions_only = (tilt_filter_of(model, settings) for _ in range(2))
        self._use_tilt = settings.measured_tilt
        self._measured_tilt: Array | None = None
        self._trust = TiltTrust()
        self._tilt_meter = NoiseMeter(2)
        self._counted: Counter[str] = Counter()
        self._present: Estimate | None = None
        super().__init__(model, period_s, settings)

    @property
    def estimate(self) -> Estimate:
        """The current estimate; put together once after each change, because a control period asks often."""
        if self._present is None:
            # Plain floats: arrays of two take longer than the arithmetic on them.
            found = self.tilt_filter
            x, y, vx, vy = found.horizontal.tolist()
            _, _, z, yaw, _, _, zd, yaw_rate = self._motion.tolist()
            c, s = math.cos(yaw), math.sin(yaw)
            motion = np.array((x, y, z, yaw, c * vx + s * vy, c * vy - s * vx, zd, yaw_rate))
            self._present = Estimate(motion, self._actuator, self._disturbance, found.estimate)
        return self._present

    @property
    def tilt_filter(self) -> TiltFilter:
        """The filter of the horizontal motion that is believed."""
        return self._with_tilt if self._use_tilt and self._trust.trusted else self._positions_only

    @property
    def events(self) -> Mapping[str, int]:
        """How often a measured tilt was distrusted, and trusted again."""
        return self._counted

    def reset(self, measurement: Measurement) -> None:
        """Start at rest at a measured pose (`PoseEstimator.reset`)."""
        self._measured_tilt = self._tilt_of(measurement)
        super().reset(measurement)
        self._present = None

    def predict(self, applied_input: Array, period_s: float) -> None:
        """Move the estimate on by one period (`PoseEstimator.predict`)."""
        super().predict(applied_input, period_s)
        self._present = None

    def correct(self, measurement: Measurement) -> bool:
        """Take in a pose (`PoseEstimator.correct`)."""
        self._measured_tilt = self._tilt_of(measurement)
        believed = super().correct(measurement)
        self._present = None
        return believed

    def take_over(self, estimate: Estimate) -> None:
        """Start from another estimator's estimate, tilt and disturbance included."""
        self._measured_tilt = None
        super().take_over(estimate)
        if estimate.tilt is not None:
            for tilt_filter, _ in self._filters():
                tilt_filter.take_over(estimate.tilt)
        self._present = None

    def position_deviation_m(self) -> Array:
        """See `TellsUncertainty`."""
        deviation = super().position_deviation_m()
        deviation[POSITION] = np.sqrt(self.tilt_filter.covariance.diagonal()[POSITION])
        return deviation

    def _filters(self) -> tuple[tuple[TiltFilter, Array | None], ...]:
        """The filters that run, and the tilt that each takes in."""
        blind = self._positions_only, None
        if not self._use_tilt:
            return (blind,)
        return (self._with_tilt, self._measured_tilt if self._trust.trusted else None), blind

    def _tilt_of(self, measurement: Measurement) -> Array | None:
        tilt = measurement.tilt if self._use_tilt else None
        return tilt if tilt is not None and np.isfinite(tilt).all() else None

    def _settle(self, applied_input: Array) -> None:
        super()._settle(applied_input)
        for tilt_filter, _ in self._filters():
            tilt_filter.settle(applied_input[:2])

    def _start(self, pose: Array, rates: Array) -> None:
        super()._start(pose, rates)
        yaw_rad = float(pose[YAW])
        self._trust.forget()
        for tilt_filter, tilt in self._filters():
            if self.standing:
                tilt_filter.stand(pose[:2], tilt, yaw_rad)
            else:
                tilt_filter.start(pose[:2], rates[:2], tilt, yaw_rad)

    def _move(self, applied_input: Array, period_s: float) -> None:
        standing, yaw_rad = self.standing, float(self._motion[YAW])
        super()._move(applied_input, period_s)
        middle_rad = yaw_rad + 0.5 * period_s * float(self._motion[YAW_RATE])
        for tilt_filter, _ in self._filters():
            if standing:
                tilt_filter.rest(applied_input[:2], period_s)
            else:
                tilt_filter.predict(applied_input, middle_rad, period_s)

    def _predicted_pose(self) -> Array:
        pose = self._motion[:INPUT_SIZE].copy()
        pose[:2] = self.tilt_filter.position_m
        return pose

    def _take_in(self, innovation: Array) -> None:
        since_pose_s = self._since_pose_s
        pose = self._motion[:INPUT_SIZE] + innovation
        pose[:2] = self.tilt_filter.position_m + innovation[:2]
        standing = self.standing
        super()._take_in(pose - self._motion[:INPUT_SIZE])
        yaw_rad = float(pose[YAW])
        tilt_noise = self._measure_tilt_noise(since_pose_s)
        if not standing:
            self._judge(yaw_rad, since_pose_s, tilt_noise)
        for tilt_filter, tilt in self._filters():
            if standing:
                tilt_filter.stand(pose[:2], tilt, yaw_rad)
            else:
                tilt_filter.correct(pose, tilt, yaw_rad)

    def _measure_tilt_noise(self, since_pose_s: float) -> tuple[float, ...]:
        """Tell the horizontal filters what noise their measurements have; that of both tilts is returned."""
        if self._measured_tilt is not None:
            self._tilt_meter.observe(self._measured_tilt, since_pose_s)
        tilt_noise = self._tilt_meter.deviation or _NO_NOISE
        for tilt_filter, _ in self._filters():
            tilt_filter.expect_noise(math.sqrt(self._measurement_variance[0]), max(tilt_noise))
        return tilt_noise

    def _judge(self, yaw_rad: float, since_pose_s: float, tilt_noise: tuple[float, ...]) -> None:
        """Compare the measured tilt with the one that positions let expect."""
        if self._measured_tilt is None:
            return
        noise_x, noise_y = tilt_noise
        if not self._trust.observe(
            _in_heading(self._measured_tilt, yaw_rad),
            _in_heading(self._positions_only.tilt, yaw_rad),
            since_pose_s,
            noise_x * noise_x + noise_y * noise_y,
        ):
            return
        if self._trust.trusted:
            self._counted[TRUSTED_AGAIN] += 1
        else:
            self._counted[DISTRUSTED] += 1
            self._with_tilt.forget_offset()


def _in_heading(tilt: Array, yaw_rad: float) -> tuple[float, float]:
    """Tilt in the heading frame."""
    x, y = tilt.tolist()
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return c * x + s * y, c * y - s * x
