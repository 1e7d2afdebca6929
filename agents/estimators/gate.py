"""Innovation gate: tells poses that the vehicle has flown to from poses that the Tracker mixed up."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.agents.estimators.settings import EstimatorSettings
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

_DEVIATIONS: Final = 5.0
_SPEED_FACTOR: Final = 2.0
_FEWEST_POSES: Final = 3
_TIME_TOLERANCE_S: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Restart:
    """What refused poses that agree with each other say about the vehicle.

    Attributes
    ----------
    rates
        Mean inertial velocity [m/s] and yaw rate [rad/s] over these poses, shape (4,).
    """

    rates: Array


@dataclass(slots=True)
class _Run:
    """Refused poses that follow each other as a flying vehicle's would."""

    first: Array
    last: Array
    poses: int = 1
    duration_s: float = 0.0
    since_last_s: float = 0.0


class InnovationGate:
    """Refuses jumps, counts them, and opens again when the jump turns out to be where the vehicle is.

    A marker swap shows the vehicle elsewhere or turned round for some frames. If refused poses go on for
    `gate_limit_s` and each could have been flown to from the one before, it is the estimate that is wrong
    (a collision, a vehicle carried by hand, poses missing for long) and the estimator has to restart there.

    Parameters
    ----------
    model
        Gives the speeds between refused poses that are believed: twice the vehicle's limits.
    settings
        Gate widths and the limit.

    Attributes
    ----------
    rejected
        Poses refused so far.
    restarts
        Times the refused poses were believed after all.
    """

    def __init__(self, model: Model, settings: EstimatorSettings) -> None:
        position_m, yaw_rad = settings.position_gate_m, settings.yaw_gate_rad
        self._margin = np.array([position_m, position_m, position_m, yaw_rad])
        speed_m_s = _SPEED_FACTOR * math.hypot(*model.state_max[3:6])
        self._fastest = np.array([speed_m_s] * 3 + [_SPEED_FACTOR * model.state_max[6]])
        self._limit_s = settings.gate_limit_s
        self._run: _Run | None = None
        self.rejected = 0
        self.restarts = 0

    def wait(self, period_s: float) -> None:
        """Let time pass."""
        if self._run is not None:
            self._run.since_last_s += period_s

    def passes(self, innovation: Array, deviation: Array) -> bool:
        """Whether a pose is near enough to the prediction.

        Parameters
        ----------
        innovation
            Measured minus predicted position and yaw, shape (4,).
        deviation
            Standard deviation of the innovation, shape (4,).

        Returns
        -------
        bool
            True if the vehicle can be there.
        """
        return bool((np.abs(innovation) <= self._margin + _DEVIATIONS * deviation).all())

    def open(self) -> None:
        """Forget refused poses, as a good one has arrived."""
        self._run = None

    def refuse(self, pose: Array) -> Restart | None:
        """Count a refused pose.

        Parameters
        ----------
        pose
            Position and unwrapped yaw, shape (4,).

        Returns
        -------
        Restart or None
            Not None if refused poses have agreed with each other for so long that they are to be believed.
        """
        self.rejected += 1
        run = self._run
        if run is None or not self._follows(run, pose):
            self._run = _Run(pose, pose)
            return None
        run.last = pose
        run.poses += 1
        run.duration_s += run.since_last_s
        run.since_last_s = 0.0
        if run.poses < _FEWEST_POSES or run.duration_s < self._limit_s - _TIME_TOLERANCE_S:
            return None
        self._run = None
        self.restarts += 1
        return Restart((run.last - run.first) / run.duration_s)

    def refuse_unreadable(self) -> None:
        """Count a pose that is not a finite place in a laboratory."""
        self.rejected += 1

    def _follows(self, run: _Run, pose: Array) -> bool:
        return bool((np.abs(pose - run.last) <= self._margin + self._fastest * run.since_last_s).all())
