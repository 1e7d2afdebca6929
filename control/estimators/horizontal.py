"""Horizontal motion with a tilt model: Kalman filters with, and without, a tilt that may not be trusted."""

from collections import Counter
from typing import Final

import msgspec

from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.estimators.tilt_filter import TiltFilter
from rcopterx.control.estimators.tilt_trust import TiltTrust
from rcopterx.control.interfaces import Estimate
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import XD_BODY, YAW, YD_BODY, Array, turned_about_z

DISTRUSTED: Final = "tilt_distrusted"
TRUSTED_AGAIN: Final = "tilt_trusted_again"


class HorizontalMotion:
    """The two filters, and whether the measured tilt is trusted. Poses have shape (4,), tilts (2,).

    There are no filters for a vehicle without a tilt model.
    """

    def __init__(self, model: Model, settings: ExtendedKalmanSettings) -> None:
        known = model.tilt is not None
        self._from_tilt = TiltFilter(model, settings) if known and settings.measured_tilt else None
        without_tilt = msgspec.structs.replace(settings, measured_tilt=False)
        self._from_positions = TiltFilter(model, without_tilt) if known else None
        self.filters = [each for each in (self._from_tilt, self._from_positions) if each is not None]
        self.trust = TiltTrust()
        self.events: Counter[str] = Counter()  # how often a measured tilt was distrusted, and trusted again

    @property
    def selected(self) -> TiltFilter | None:
        """The filter whose estimate is used."""
        return self._from_tilt if self._from_tilt is not None and self.trust.trusted else self._from_positions

    def refine(self, estimate: Estimate) -> Estimate:
        """Replace the horizontal motion of an estimate, in place, and add the tilt."""
        selected = self.selected
        if selected is None:
            return estimate
        motion = estimate.motion
        motion[:2] = selected.position_m
        motion[XD_BODY : YD_BODY + 1] = turned_about_z(selected.velocity_m_s, -float(motion[YAW]))
        return estimate._replace(tilt=selected.estimate)

    def start(self, pose: Array, rates: Array, tilt: Array | None) -> None:
        """Start in the air at a pose with inertial rates, shape (4,)."""
        self.trust.restart()
        for each in self.filters:
            each.start(pose[:2], rates[:2], self._usable(tilt, each), float(pose[YAW]))

    def stand(self, pose: Array, tilt: Array | None) -> None:
        """Start at rest on the floor."""
        self.trust.restart()
        self._stand(pose, tilt)

    def _stand(self, pose: Array, tilt: Array | None) -> None:
        for each in self.filters:
            each.stand(pose[:2], self._usable(tilt, each), float(pose[YAW]))

    def _usable(self, tilt: Array | None, filter_: TiltFilter) -> Array | None:
        """The measured tilt if that filter may use it."""
        return tilt if filter_ is self._from_tilt and self.trust.trusted else None

    def correct(self, pose: Array, tilt: Array | None, noise_m: float, since_pose_s: float) -> None:
        """Correct by a pose, `since_pose_s` after the last one, with standard deviation `noise_m`."""
        yaw_rad = float(pose[YAW])
        if tilt is not None and self._from_positions is not None:
            expected = self._from_positions.tilt
            if self.trust.observe(tilt, expected, yaw_rad, since_pose_s):
                self.events[TRUSTED_AGAIN if self.trust.trusted else DISTRUSTED] += 1
                if self._from_tilt is not None and not self.trust.trusted:
                    self._from_tilt.forget_offset()
        self._expect_noise(noise_m)
        for each in self.filters:
            each.correct(pose[:2], self._usable(tilt, each), yaw_rad)

    def correct_standing(self, pose: Array, tilt: Array | None, noise_m: float, since_pose_s: float) -> None:
        """Correct the estimate of a standing vehicle; arguments of `correct`."""
        if tilt is not None:
            self.trust.observe_noise(tilt, since_pose_s)
        self._expect_noise(noise_m)
        self._stand(pose, tilt)

    def _expect_noise(self, noise_m: float) -> None:
        for each in self.filters:
            each.expect_noise(noise_m, self.trust.noise_deviation)
