"""The default estimator: extended Kalman filter of motion, actuators, disturbances and tilt.

`LagFilter` estimates all vehicles, `HorizontalMotion` replaces the horizontal motion of those with a tilt
model: Kalman filters with, and without, a tilt that may not be trusted. Here it is decided when the vehicle
stands on the floor, and how much noise the poses have.
"""

import math
from collections import Counter
from typing import Any, Final

import msgspec
import numpy as np

from rcopterx.control.estimators.base import PoseEstimator
from rcopterx.control.estimators.filters import ACTUATOR, POSE, LagFilter, TiltFilter
from rcopterx.control.estimators.noise import NoiseMeter, TiltTrust
from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.models.lateral import POSITION, VELOCITY
from rcopterx.control.models.prediction import actuator_response
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import (
    INPUT_SIZE,
    U_THRUST,
    XD_BODY,
    YAW,
    YAW_RATE,
    YD_BODY,
    Array,
    turned_about_z,
)

DISTRUSTED: Final = "tilt_distrusted"
TRUSTED_AGAIN: Final = "tilt_trusted_again"
LEVER_ARM_FOUND: Final = "lever_arm_found"  # at most once in a flight
_LIKELIER: Final = 10.0  # log of the likelihoods' ratio from which on the filter with a lever arm is used
_KNOWN_M: Final = 0.001  # standard deviation from which on it is sought no more


class HorizontalMotion:
    """The filters, and whether the measured tilt is trusted. Poses have shape (4,), tilts (2,).

    There are no filters for a vehicle without a tilt model. The lever arm is that of the model until a
    filter that estimates it explains the poses much better: errors of a model resemble one of 1 to 2 cm, and
    a filter that takes them for a lever arm makes the loop swing.
    """

    def __init__(self, model: Model, settings: ExtendedKalmanSettings) -> None:
        def new_filter(used: bool, **changes: Any) -> TiltFilter | None:
            return TiltFilter(model, msgspec.structs.replace(settings, **changes)) if used else None

        known = model.tilt is not None
        with_tilt = known and settings.measured_tilt
        self._from_positions = new_filter(known, measured_tilt=False)
        self._from_tilt = new_filter(with_tilt, lever_arm_deviation_m=0.0)
        self._with_lever = new_filter(with_tilt and settings.lever_arm_deviation_m > 0.0)
        self.trust = TiltTrust()
        self.events: Counter[str] = Counter()  # how often a measured tilt was distrusted, and trusted again
        self._begin()

    def _begin(self) -> None:
        """Run all filters, as of a vehicle whose lever arm is that of the model until it is found."""
        present = self._from_tilt, self._from_positions, self._with_lever
        self.filters = [each for each in present if each is not None]
        self._lever_found, self._likelier = False, 0.0

    @property
    def selected(self) -> TiltFilter | None:
        """The filter whose estimate is used."""
        if self._from_tilt is None or not self.trust.trusted:
            return self._from_positions
        return self._with_lever if self._lever_found else self._from_tilt

    def refine(self, estimate: Estimate) -> Estimate:
        """Replace the horizontal motion of an estimate, in place, and add the tilt."""
        selected = self.selected
        if selected is None:
            return estimate
        motion = estimate.motion
        motion[:2] = selected.x[POSITION]
        motion[XD_BODY : YD_BODY + 1] = turned_about_z(selected.x[VELOCITY], -float(motion[YAW]))
        return estimate._replace(tilt=selected.estimate)

    def start(self, pose: Array, rates: Array, tilt: Array | None) -> None:
        """Start in the air at a pose with inertial rates, shape (4,)."""
        self.trust.restart()
        for each, usable in self._measuring(tilt):
            each.start(pose[:2], rates[:2], usable, float(pose[YAW]))

    def stand(self, pose: Array, tilt: Array | None) -> None:
        """Start at rest on the floor."""
        self._begin()
        self.trust.restart()
        for each, usable in self._measuring(tilt):
            each.stand(pose[:2], usable, float(pose[YAW]))

    def _measuring(self, tilt: Array | None) -> list[tuple[TiltFilter, Array | None]]:
        """Each filter, with the measured tilt if it may use it."""
        usable = tilt if self.trust.trusted else None
        return [(each, None if each is self._from_positions else usable) for each in self.filters]

    def correct(self, pose: Array, tilt: Array | None, noise_m: float, since_pose_s: float) -> None:
        """Correct by a pose, `since_pose_s` after the last one, with standard deviation `noise_m`."""
        yaw_rad = float(pose[YAW])
        if tilt is not None and self._from_positions is not None:
            expected = self._from_positions.tilt
            if self.trust.observe(tilt, expected, yaw_rad, since_pose_s):
                self.events[TRUSTED_AGAIN if self.trust.trusted else DISTRUSTED] += 1
                if not self.trust.trusted:
                    for each in self.filters:
                        each.forget_offset()
        likelihoods = []
        for each, usable in self._measuring(tilt):
            each.expect_noise(noise_m, self.trust.noise_deviation)
            likelihoods.append(each.correct(pose[:2], usable, yaw_rad))
        if self._with_lever is not None and len(self.filters) > 2 and tilt is not None and self.trust.trusted:
            self._seek_lever(self._with_lever, likelihoods[-1] - likelihoods[0])

    def _seek_lever(self, with_lever: TiltFilter, likelier: float) -> None:
        """Decide whether the lever arm differs from that of the model, by logs of the likelihoods' ratio."""
        self._likelier = max(self._likelier + likelier, 0.0)
        _, deviation_m = with_lever.lever_arm_m
        if self._likelier > _LIKELIER:
            self._lever_found = True
            self.events[LEVER_ARM_FOUND] += 1
            del self.filters[0]
        elif deviation_m < _KNOWN_M:
            del self.filters[-1]

    def correct_standing(self, pose: Array, tilt: Array | None, noise_m: float, since_pose_s: float) -> None:
        """Correct the estimate of a standing vehicle; arguments of `correct`."""
        if tilt is not None:
            self.trust.observe_noise(tilt, since_pose_s)
        for each, usable in self._measuring(tilt):
            each.expect_noise(noise_m, self.trust.noise_deviation)
            each.stand(pose[:2], usable, float(pose[YAW]))


_LIFTING_FRACTION: Final = 0.9  # modelled thrust over weight from which a standing vehicle may lift
_MOVED_M: Final = 0.01  # distance from where it stood that shows that a vehicle stands no more


class ExtendedKalmanEstimator(PoseEstimator):
    """Motion, actuators, disturbances and tilt from poses and applied inputs.

    On the floor the model does not hold: with the thrust off it falls, and a filter would explain its rest by
    an upward disturbance of one gravity, which a controller would then trust at take-off. Hence *standing*:
    after a start, and whenever the upward disturbance reaches its limit while the thrust cannot carry the
    weight (only a floor pushes so hard), the vehicle rests where it is measured, without disturbance, until
    the modelled thrust comes near the weight or the pose moves by a centimetre. A start in the air ends
    standing with the first prediction, because the applied thrust carries the weight.

    `lag_filter`: the filter of motion, actuators and disturbances. `horizontal`: those of the horizontal
    motion of a vehicle with a tilt model.
    """

    Settings = ExtendedKalmanSettings

    def __init__(self, model: Model, period_s: float, settings: ExtendedKalmanSettings) -> None:
        super().__init__(model, settings)
        self.lag_filter = LagFilter(model, settings)
        self.horizontal = HorizontalMotion(model, settings)
        self.events = self.horizontal.events
        self._uses_tilt = settings.measured_tilt and model.tilt is not None
        self._tilt: Array | None = None  # tilt of the pose that is being processed, if it is measured
        self._settings = settings
        self.standing = True
        self._noise_meter = NoiseMeter(INPUT_SIZE)
        self._expect_noise(0.0, 0.0)
        self._since_pose_s = 0.0
        self._start(np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE))
        # Compute the matrices of the nominal period before the flight.
        self._filter_prediction(model.hover_input, period_s)
        self._start(np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE))

    @property
    def estimate(self) -> Estimate:
        """The current estimate."""
        return self.horizontal.refine(self.lag_filter.estimate)

    def position_deviation_m(self) -> Array:
        """See `EstimatesUncertainty`."""
        variance = self.lag_filter.P.diagonal()[:YAW].copy()
        selected = self.horizontal.selected
        if selected is not None:
            variance[:2] = selected.P.diagonal()[:2]
        return np.asarray(np.sqrt(variance))

    def reset(self, measurement: Measurement) -> None:
        """Start at rest at a measured pose (`PoseEstimator.reset`)."""
        self._set_tilt(measurement)
        super().reset(measurement)

    def predict(self, applied_input: Array, period_s: float) -> None:
        """Predict by one period (`PoseEstimator.predict`)."""
        self._begin(applied_input, period_s)
        self._since_pose_s += period_s
        if not self.standing:
            self._filter_prediction(applied_input, period_s)
            return
        x = self.lag_filter.x
        x[ACTUATOR] = actuator_response(self._model, x[ACTUATOR], applied_input, 0.0, period_s)
        self.standing = not self._thrust_carries()
        for each in self.horizontal.filters:
            each.rest(applied_input[:2], period_s)

    def correct(self, measurement: Measurement) -> bool:
        """Correct the estimate by a pose (`PoseEstimator.correct`)."""
        self._set_tilt(measurement)
        predicted, selected = self.lag_filter.x[POSE].copy(), self.horizontal.selected
        if selected is not None:
            predicted[:2] = selected.x[POSITION] + selected.origin_m
        deviation = np.sqrt(self.lag_filter.P.diagonal()[POSE] + self._R)
        accepted, pose = self._accept(measurement, predicted, deviation)
        if pose is not None:
            self._update(pose)
        return accepted

    def _set_tilt(self, measurement: Measurement) -> None:
        tilt = measurement.tilt if self._uses_tilt else None
        self._tilt = tilt if tilt is not None and all(map(math.isfinite, tilt.tolist())) else None

    def take_over(self, estimate: Estimate) -> None:
        """Start from another estimator's estimate, tilt and disturbance included."""
        self._tilt = None
        super().take_over(estimate)
        self.lag_filter.set_disturbance(estimate.disturbance)
        if estimate.has_tilt:
            for each in self.horizontal.filters:
                each.take_over(estimate.tilt)

    def _set_actuators(self, applied_input: Array) -> None:
        self.lag_filter.x[ACTUATOR] = applied_input
        for each in self.horizontal.filters:
            each.set_servo(applied_input[:2])

    def _start(self, pose: Array, rates: Array) -> None:
        self.lag_filter.start(pose, rates)
        self.standing = not rates.any()
        self._stood_at_m = pose[:YAW]
        if self.standing:
            self.horizontal.stand(pose, self._tilt)
        else:
            self.horizontal.start(pose, rates, self._tilt)

    def _move(self, offset: Array) -> None:
        self.lag_filter.move(offset)
        for each in self.horizontal.filters:
            each.move(offset[:2])
        self._stood_at_m = self._stood_at_m + offset[:YAW]

    def _thrust_carries(self) -> bool:
        thrust = self._model.input_gain[U_THRUST] * float(self.lag_filter.x[ACTUATOR][U_THRUST])
        return thrust > _LIFTING_FRACTION * self._model.gravity_m_s2

    def _filter_prediction(self, applied_input: Array, period_s: float) -> None:
        start_rad = float(self.lag_filter.x[YAW])
        self.lag_filter.predict(applied_input, period_s)
        middle_rad = start_rad + 0.5 * period_s * float(self.lag_filter.x[YAW_RATE])
        for each in self.horizontal.filters:
            each.predict(applied_input[:2], middle_rad, period_s)

    def _update(self, pose: Array) -> None:
        since_pose_s, self._since_pose_s = self._since_pose_s, 0.0
        self._measure_noise(pose, since_pose_s)
        if self.standing:
            self.lag_filter.x[POSE] = pose
            self.standing = bool((np.abs(pose[:YAW] - self._stood_at_m) < _MOVED_M).all())
            self.horizontal.correct_standing(pose, self._tilt, self._noise_m, since_pose_s)
            return
        self.lag_filter.correct(pose, self._R)
        if self.lag_filter.disturbance_at_limit and not self._thrust_carries():
            self._start(self.lag_filter.x[POSE], np.zeros(INPUT_SIZE))
        self.horizontal.correct(pose, self._tilt, self._noise_m, since_pose_s)

    def _measure_noise(self, pose: Array, since_pose_s: float) -> None:
        """Expect the noise of the worst axis for all positions."""
        self._noise_meter.observe(pose, since_pose_s)
        deviation = self._noise_meter.deviation
        if deviation is not None:
            self._expect_noise(max(deviation[:YAW]), deviation[YAW])

    def _expect_noise(self, position_m: float, yaw_rad: float) -> None:
        """Set the standard deviations of measured poses; at least those of the settings."""
        self._noise_m = max(position_m, self._settings.position_noise_m)
        yaw_rad = max(yaw_rad, self._settings.yaw_noise_rad)
        self._R = np.array((*3 * (self._noise_m**2,), yaw_rad**2))
