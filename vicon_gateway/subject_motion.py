"""Motion of a tracked subject that is no vehicle, as a wand or a hand, from its poses alone.

A Kalman filter estimates place, heading, their rates and accelerations. The filter and the plan have the same
model, in which accelerations and rates die out, because what people move comes to rest (docs/formation.md).
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.linalg import expm

from rcopterx.control.models.linear import noise_over
from rcopterx.control.references.columns import COLUMNS, POSITION
from rcopterx.control.references.trajectory import Trajectory, nearest_heading
from rcopterx.formation.law import LeaderPlan
from rcopterx.vehicles.state import YAW, Array

RATE_S: Final = 1.0
ACCELERATION_S: Final = 1.0  # time constants with which rates and accelerations die out
DYNAMICS: Final = np.array([[0.0, 1.0, 0.0], [0.0, -1.0 / RATE_S, 1.0], [0.0, 0.0, -1.0 / ACCELERATION_S]])
NOISE: Final = np.array([0.0, 0.0, 10.0])  # spectral density of the jerk [m^2/s^5]
MEASURED_M: Final = 5e-4  # standard deviation of places; headings are ten times as noisy and lively, in rad
UNKNOWN: Final = np.array([MEASURED_M, 1.0, 3.0])  # standard deviations at first [m, m/s, m/s^2]
JUMP_M: Final = 0.1
JUMP_DEVIATIONS: Final = 4.0  # a place that is both farther away than predicted is that of another body

PERIOD_S: Final = 0.02
STAGES: Final = 51
SETTLING_S: Final = 0.6  # a subject is followed from so long after it appeared, or jumped
FOLLOWED_S: Final = 0.4
AVOIDED_S: Final = 2.0  # for so long a subject that is not seen is followed, and avoided where it may be
DEVIATIONS: Final = 0.5  # standard deviations of its place that others keep in addition...
MOST_M: Final = 0.3  # ...at most


@lru_cache
def _over(period_s: float) -> tuple[Array, Array]:
    """Return the transition over a period, and the covariance that it adds."""
    return np.asarray(expm(period_s * DYNAMICS)), noise_over(DYNAMICS, NOISE, period_s)


_STAGES = [_over(PERIOD_S * stage) for stage in range(STAGES)]
_TRANSITIONS: Final = np.array([transition for transition, _ in _STAGES])
_ADDED: Final = np.array([added[0, 0] for _, added in _STAGES])


class SubjectMotion:
    """Estimated motion of one subject; `fastest` are the rates x, y, z, heading that followers can fly."""

    def __init__(self, fastest: Sequence[float]) -> None:
        self._fastest = np.array(fastest)
        self.motion: Array = np.zeros((3, 4))
        """Place x, y, z and heading, in the rows below their rates and accelerations."""
        self._covariance = np.diag(UNKNOWN**2)  # of one column
        self.unseen_s = np.inf  # for so long it has not been seen; infinite before it was
        self._known_s = 0.0  # since it appeared, or jumped

    def advance(self, elapsed_s: float) -> None:
        """Predict over the time since the last frame."""
        self.unseen_s, self._known_s = self.unseen_s + elapsed_s, self._known_s + elapsed_s
        if self.unseen_s <= AVOIDED_S:
            transition, added = _over(elapsed_s)
            self.motion = transition @ self.motion
            self._covariance = transition @ self._covariance @ transition.T + added

    def correct(self, position_m: Array, yaw_rad: float) -> None:
        """Correct by a place with its heading, or begin there."""
        place = np.append(position_m, nearest_heading(yaw_rad, float(self.motion[0, YAW])))
        surprise, variance = place - self.motion[0], float(self._covariance[0, 0]) + MEASURED_M**2
        reach_m = JUMP_M + JUMP_DEVIATIONS * float(np.sqrt(variance))
        if self.unseen_s > FOLLOWED_S or np.linalg.norm(surprise[POSITION]) > reach_m:
            self.motion, self._covariance = np.zeros((3, 4)), np.diag(UNKNOWN**2)
            self.motion[0], self._known_s = place, 0.0
        else:
            gain = self._covariance[:, 0] / variance
            self.motion = self.motion + np.outer(gain, surprise)
            self._covariance = self._covariance - np.outer(gain, self._covariance[0])
        self.unseen_s = 0.0

    def plan(self) -> LeaderPlan | None:
        """Return the plan from the present on, None if the subject has not been seen for a while.

        Its nominal part, which vehicles follow, is no faster than they can fly.
        """
        if self.unseen_s > AVOIDED_S:
            return None
        predicted = (_TRANSITIONS @ self.motion).reshape(STAGES, COLUMNS)
        share = float(np.abs(self.motion[1] / self._fastest).max())
        flown = self.motion / ([1.0], [max(1.0, share)], [max(1.0, share)])
        by_place = _TRANSITIONS[:, 0]
        variance = np.einsum("ki,ij,kj->k", by_place, self._covariance, by_place) + _ADDED
        margins_m = np.minimum(DEVIATIONS * np.sqrt(variance), MOST_M)
        return LeaderPlan(
            Trajectory(predicted, PERIOD_S),
            0.0,
            self._known_s >= SETTLING_S and self.unseen_s <= FOLLOWED_S,
            Trajectory((_TRANSITIONS @ flown).reshape(STAGES, COLUMNS), PERIOD_S),
            tuple(margins_m.tolist()),
        )
