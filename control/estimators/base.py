"""Base class of the estimators: start and take-over, unwrapped yaw, and the innovation gate.

The gate separates poses that the vehicle has flown to from poses that the Tracker mixed up.
"""

import math
import operator
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.control.estimators.settings import EstimatorSettings
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.references.trajectory import nearest_heading
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, YAW, Array, inertial_rates

_DEVIATIONS: Final = 5.0  # departures from the prediction by so many standard deviations are noise
_SUDDEN_M: Final = 0.02  # a pose further from the predicted one, noise apart, waits until another one agrees
_UNKNOWN_M_S2: Final = 5.0  # acceleration that a prediction without poses misses if half the thrust is wrong
_MOST_SUDDEN: Final = 4  # so many sudden poses in a row that do not agree are rejected
_SPEED_FACTOR: Final = 2.0
_FEWEST_POSES: Final = 3
_TIME_TOLERANCE_S: Final = 1e-9


@dataclass(slots=True)
class _Run:
    """Refused poses that follow each other as a flying vehicle's would; the first one's innovation."""

    offset: Array
    last: Array
    poses: int = 1
    duration_s: float = 0.0


class InnovationGate:
    """Refuses jumps, counts them, and opens again when the jump turns out to be where the vehicle is.

    If refused poses go on for `gate_limit_s`, each within twice the limits of the vehicle from the one
    before, they are believed. Until then the estimate follows their motion. A sudden pose near enough, as
    of one marker taken for another, is rejected until two in a row agree.
    """

    def __init__(self, model: Model, settings: EstimatorSettings) -> None:
        self._widths = np.array(3 * [settings.position_gate_m] + [settings.yaw_gate_rad])
        speed_m_s = math.hypot(*model.state_max[3:6])
        self._fastest = _SPEED_FACTOR * np.array(3 * [speed_m_s] + [model.state_max[6]])
        self._limit_s = settings.gate_limit_s
        self._run: _Run | None = None
        self._last_sudden: Array | None = None  # innovation of the last pose if that was sudden
        self._sudden = 0  # how many were in a row
        self._waited_s = 0.0  # time since the last pose
        self.rejected = 0  # poses refused so far
        self.restarts = 0  # times the refused poses were believed after all

    def wait(self, period_s: float) -> None:
        """Let time pass."""
        self._waited_s += period_s

    def open(self) -> None:
        """Forget refused poses and the time before, as the estimator restarts."""
        self._run, self._waited_s = None, 0.0

    def judge(self, pose: Array, innovation: Array, deviation: Array) -> tuple[bool, Array | None]:
        """Judge a pose (position and unwrapped yaw), its innovation and that one's standard deviation.

        Returns whether it is accepted, and where the poses are from where the estimate is, if elsewhere: the
        estimate moves there with an accepted pose, else it follows the motion of the poses in parallel. All
        have shape (4,).
        """
        waited_s, self._waited_s = self._waited_s, 0.0
        allowed = _DEVIATIONS * deviation
        allowed[:3] += 0.5 * _UNKNOWN_M_S2 * waited_s**2
        if not _within(innovation, self._widths + allowed):
            return self._refuse(pose, innovation, waited_s)
        self._run = None
        return self._judge_sudden(innovation, _SUDDEN_M + allowed[:3])

    def _judge_sudden(self, innovation: Array, near_m: Array) -> tuple[bool, Array | None]:
        before, self._last_sudden, innovation_m = self._last_sudden, None, innovation[:3]
        near = _within(innovation_m, near_m)
        agrees = not near and before is not None and _within(innovation_m - before, near_m)
        if not (near or agrees or self._sudden == _MOST_SUDDEN):
            self._last_sudden = innovation_m
            self._sudden += 1
            self.rejected += 1
            return False, None
        self._sudden = 0
        return True, innovation if agrees else None

    def _refuse(self, pose: Array, innovation: Array, waited_s: float) -> tuple[bool, Array | None]:
        self.rejected += 1
        run = self._run
        if run is None or not _within(pose - run.last, self._widths + self._fastest * waited_s):
            self._run = _Run(innovation, pose)
            return False, None
        run.last = pose
        run.poses += 1
        run.duration_s += waited_s
        believed = run.poses >= _FEWEST_POSES and run.duration_s >= self._limit_s - _TIME_TOLERANCE_S
        if believed:
            self._run = None
            self.restarts += 1
        return believed, run.offset


# no laboratory has poses beyond these
FARTHEST_M: Final = 1e3
MOST_TURNED_RAD: Final = 1e4


class PoseEstimator(ABC):
    """An `Estimator` from poses; its subclasses call `_begin` in `predict`, and `_accept` in `correct`.

    Poses are position and unwrapped yaw, shape (4,). A measured yaw is unwrapped to the one of its turns that
    is nearest to the prediction. The very first `predict` assumes that the actuators have settled on its
    input, and `reset` keeps the actuator states, which do not depend on poses: so call `predict` in every
    period, on the floor too.
    """

    def __init__(self, model: Model, settings: EstimatorSettings) -> None:
        self._model = model
        self._gate = InnovationGate(model, settings)
        self._yaw_known = False
        self._actuators_known = False

    @property
    @abstractmethod
    def estimate(self) -> Estimate:
        """The current estimate."""

    @property
    def rejected(self) -> int:
        """Poses refused so far: jumps that the vehicle cannot have flown, and unreadable poses."""
        return self._gate.rejected

    @property
    def restarts(self) -> int:
        """Times refused poses were believed after all, because they went on and agreed with each other."""
        return self._gate.restarts

    def reset(self, measurement: Measurement) -> None:
        """Start at rest at a measured pose; ValueError if it is not finite.

        The yaw of the first one is taken as it is, later ones are unwrapped.
        """
        if not _readable(measurement):
            raise ValueError(f"cannot start at {measurement}: not a finite place in a laboratory")
        yaw_rad = measurement.yaw_rad
        if self._yaw_known:
            yaw_rad = nearest_heading(yaw_rad, float(self.estimate.motion[YAW]))
        self._yaw_known = True
        self._gate.open()
        self._start(_pose_of(measurement, yaw_rad), np.zeros(INPUT_SIZE))

    def take_over(self, estimate: Estimate) -> None:
        """Start from another estimator's estimate of the present moment."""
        motion = estimate.motion
        self._yaw_known = self._actuators_known = True
        self._set_actuators(estimate.actuator)
        self._gate.open()
        self._start(motion[:INPUT_SIZE].copy(), inertial_rates(motion))

    @abstractmethod
    def predict(self, applied_input: Array, period_s: float) -> None:
        """Predict by one period, during which an input acted at the vehicle, shape (4,).

        Raises `ValueError`: the input is not finite.
        """

    @abstractmethod
    def correct(self, measurement: Measurement) -> bool:
        """Correct the estimate by a fresh, unoccluded pose of the instant up to which was predicted.

        Returns False if the pose was refused because the vehicle cannot have flown there.
        """

    def _begin(self, applied_input: Array, period_s: float) -> None:
        """Begin a prediction: check its input, which the actuators have settled on before the first one."""
        if not all(map(math.isfinite, applied_input.tolist())):
            raise ValueError(f"applied input {applied_input} is not finite")
        if not self._actuators_known:
            self._actuators_known = True
            self._set_actuators(applied_input)
        self._gate.wait(period_s)

    def _accept(
        self, measurement: Measurement, predicted: Array, deviation: Array
    ) -> tuple[bool, Array | None]:
        """Return whether a pose is accepted, compared with one of shape (4,), and the one to correct by."""
        if not _readable(measurement):
            self._gate.rejected += 1
            return False, None
        if not self._yaw_known:
            self.reset(measurement)
            return True, None
        yaw_rad = nearest_heading(measurement.yaw_rad, float(predicted[YAW]))
        pose = _pose_of(measurement, yaw_rad)
        accepted, offset = self._gate.judge(pose, pose - predicted, deviation)
        if offset is None:
            return accepted, pose if accepted else None
        if not accepted:
            return False, pose - offset
        self._move(offset)
        return True, pose

    @abstractmethod
    def _set_actuators(self, applied_input: Array) -> None:
        """Set the actuator states to an input that has been acting for long, shape (4,)."""

    @abstractmethod
    def _start(self, pose: Array, rates: Array) -> None:
        """Start at a pose with inertial velocity and yaw rate, both of shape (4,)."""

    def _move(self, offset: Array) -> None:
        """Move position and yaw by an offset, shape (4,); the inertial motion stays."""
        motion = self.estimate.motion
        self._start(motion[:INPUT_SIZE] + offset, inertial_rates(motion))


def _pose_of(measurement: Measurement, yaw_rad: float) -> Array:
    """Measured position and unwrapped yaw, shape (4,)."""
    return np.array((*measurement.position_m.tolist(), yaw_rad))


def _within(differences: Array, limits: Array) -> bool:
    return all(map(operator.le, np.abs(differences).tolist(), limits.tolist()))


def _readable(measurement: Measurement) -> bool:
    # Comparisons with nan are false.
    inside = all(abs(coordinate) <= FARTHEST_M for coordinate in measurement.position_m.tolist())
    return inside and abs(measurement.yaw_rad) <= MOST_TURNED_RAD
