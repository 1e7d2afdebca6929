"""Innovation gate: tells poses that the vehicle has flown to from poses that the Tracker mixed up."""

import math
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

import numpy as np

from rcopterx.control.estimators.settings import EstimatorSettings
from rcopterx.native.kalman import DEVIATIONS as _DEVIATIONS
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

_SUDDEN_M: Final = 0.02
"""A pose further than this from the predicted one, besides noise, waits for another one to agree."""
_MOST_LEFT_OUT: Final = 4
"""So many sudden poses that do not agree are left out in a row."""
_SPEED_FACTOR: Final = 2.0
_FEWEST_POSES: Final = 3
_TIME_TOLERANCE_S: Final = 1e-9


class Sudden(Enum):
    """What a pose that can have been flown to is taken for."""

    NOT = auto()
    """To be taken in."""
    ALONE = auto()
    """Further off than any before it: to be left out."""
    SHIFT = auto()
    """As far off as the last one that was left out: the vehicle is measured elsewhere from now on."""


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

    A single pose off by some centimetres, of one marker taken for another, is near enough to have been flown
    to, and would kick the sticks. So sudden ones are left out until two in a row agree that the measured
    body has shifted.

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
    near
        Innovations up to which a pose is nothing to think about, besides five deviations; shape (4,).
    """

    def __init__(self, model: Model, settings: EstimatorSettings) -> None:
        position_m, yaw_rad = settings.position_gate_m, settings.yaw_gate_rad
        self._position_m, self._yaw_rad = position_m, yaw_rad
        self._margin = np.array([position_m, position_m, position_m, yaw_rad])
        self.near: Array = np.array([*3 * [min(position_m, _SUDDEN_M)], yaw_rad])
        speed_m_s = _SPEED_FACTOR * math.hypot(*model.state_max[3:6])
        self._fastest = np.array([speed_m_s] * 3 + [_SPEED_FACTOR * model.state_max[6]])
        self._limit_s = settings.gate_limit_s
        self._run: _Run | None = None
        self._last_sudden: tuple[float, float, float] | None = None
        self._left_out = 0
        """Innovation of the last pose that was left out as a sudden one, and how many were in a row."""
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
        # Plain floats, one by one: arrays and loops take longer than the arithmetic on them.
        errors: list[float] = innovation.tolist()
        spreads: list[float] = deviation.tolist()
        (x, y, z, yaw), (near_x, near_y, near_z, near_yaw) = errors, spreads
        return (
            abs(x) <= self._position_m + _DEVIATIONS * near_x
            and abs(y) <= self._position_m + _DEVIATIONS * near_y
            and abs(z) <= self._position_m + _DEVIATIONS * near_z
            and abs(yaw) <= self._yaw_rad + _DEVIATIONS * near_yaw
        )

    def sudden(self, innovation: Array, deviation: Array) -> Sudden:
        """What a pose that passes is taken for.

        Parameters
        ----------
        innovation, deviation
            See `passes`.
        """
        spread_x, spread_y, spread_z, _ = deviation.tolist()
        near = (
            _SUDDEN_M + _DEVIATIONS * spread_x,
            _SUDDEN_M + _DEVIATIONS * spread_y,
            _SUDDEN_M + _DEVIATIONS * spread_z,
        )
        x, y, z, _ = innovation.tolist()
        before, left_out = self._last_sudden, self._left_out
        self._last_sudden, self._left_out = None, 0
        if abs(x) <= near[0] and abs(y) <= near[1] and abs(z) <= near[2]:
            return Sudden.NOT
        away = x, y, z
        if before is not None and all(
            abs(gap - last) <= limit for gap, last, limit in zip(away, before, near, strict=True)
        ):
            return Sudden.SHIFT
        if left_out == _MOST_LEFT_OUT:
            return Sudden.NOT
        self._last_sudden, self._left_out = away, left_out + 1
        self.rejected += 1
        return Sudden.ALONE

    def open(self) -> None:
        """Forget refused poses, as a good one has arrived."""
        self._run = None

    def note_near(self) -> None:
        """A pose has arrived that is `near`, which needs no `passes` nor `sudden` to be taken in."""
        self._run = self._last_sudden = None
        self._left_out = 0

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
