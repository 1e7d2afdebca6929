"""Innovation gate: separates poses that the vehicle has flown to from poses that the Tracker mixed up."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.control.estimators.settings import EstimatorSettings
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

_DEVIATIONS: Final = 5.0
"""Departures from the prediction by so many standard deviations are noise."""
_SUDDEN_M: Final = 0.02
"""A pose further than this from the predicted one, besides noise, waits for another one to agree."""
_MOST_SUDDEN: Final = 4
"""So many sudden poses in a row that do not agree are rejected."""
_SPEED_FACTOR: Final = 2.0
_FEWEST_POSES: Final = 3
_TIME_TOLERANCE_S: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Verdict:
    """What to do with a pose."""

    accepted: bool
    restart: bool = False
    """The estimator has to restart at the pose."""
    rates: Array | None = None
    """Inertial velocity and yaw rate to restart with, shape (4,); None for the estimated ones."""


ACCEPT: Final = Verdict(accepted=True)
REJECT: Final = Verdict(accepted=False)
SHIFT: Final = Verdict(accepted=True, restart=True)
"""The pose is as far off as the last sudden one: the vehicle is measured elsewhere from now on."""


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
    `gate_limit_s` and each could have been flown to from the one before (at up to twice the limits of the
    vehicle), the estimate is wrong (a collision, a vehicle carried by hand, poses missing for long) and the
    estimator has to restart there.

    A single pose off by some centimetres, of one marker taken for another, is near enough to have been flown
    to, and would kick the sticks. So sudden ones are rejected until two in a row agree that the measured body
    has shifted.
    """

    def __init__(self, model: Model, settings: EstimatorSettings) -> None:
        self._widths = np.array(3 * [settings.position_gate_m] + [settings.yaw_gate_rad])
        speed_m_s = math.hypot(*model.state_max[3:6])
        self._fastest = _SPEED_FACTOR * np.array(3 * [speed_m_s] + [model.state_max[6]])
        self._limit_s = settings.gate_limit_s
        self._run: _Run | None = None
        self._last_sudden: Array | None = None
        self._sudden = 0
        """Innovation of the last pose if that was sudden, and how many were in a row."""
        self.rejected = 0
        """Poses refused so far."""
        self.restarts = 0
        """Times the refused poses were believed after all."""

    def wait(self, period_s: float) -> None:
        """Let time pass."""
        if self._run is not None:
            self._run.since_last_s += period_s

    def open(self) -> None:
        """Forget refused poses, as the estimator restarts."""
        self._run = None

    def refuse_unreadable(self) -> None:
        """Count a pose that is not a finite place in a laboratory."""
        self.rejected += 1

    def judge(self, pose: Array, innovation: Array, deviation: Array) -> Verdict:
        """Judge a pose (position and unwrapped yaw), its innovation and that one's standard deviation.

        All have shape (4,).
        """
        noise = _DEVIATIONS * deviation
        if not (np.abs(innovation) <= self._widths + noise).all():
            return self._refuse(pose)
        self._run = None
        return self._judge_sudden(innovation[:3], _SUDDEN_M + noise[:3])

    def _judge_sudden(self, innovation_m: Array, near_m: Array) -> Verdict:
        before, self._last_sudden = self._last_sudden, None
        if (np.abs(innovation_m) <= near_m).all():
            verdict = ACCEPT
        elif before is not None and (np.abs(innovation_m - before) <= near_m).all():
            verdict = SHIFT
        elif self._sudden == _MOST_SUDDEN:
            verdict = ACCEPT
        else:
            self._last_sudden = innovation_m
            self._sudden += 1
            self.rejected += 1
            return REJECT
        self._sudden = 0
        return verdict

    def _refuse(self, pose: Array) -> Verdict:
        self.rejected += 1
        run = self._run
        if run is None or not self._follows(run, pose):
            self._run = _Run(pose, pose)
            return REJECT
        run.last = pose
        run.poses += 1
        run.duration_s += run.since_last_s
        run.since_last_s = 0.0
        if run.poses < _FEWEST_POSES or run.duration_s < self._limit_s - _TIME_TOLERANCE_S:
            return REJECT
        self._run = None
        self.restarts += 1
        return Verdict(accepted=True, restart=True, rates=(run.last - run.first) / run.duration_s)

    def _follows(self, run: _Run, pose: Array) -> bool:
        return bool((np.abs(pose - run.last) <= self._widths + self._fastest * run.since_last_s).all())
