"""Base class of the estimators: unwrapped yaw, and the innovation gate with its counters."""

import math
from abc import ABC, abstractmethod
from typing import Final

import numpy as np

from rcopterx.control.estimators.base import InnovationGate
from rcopterx.control.estimators.settings import EstimatorSettings
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.references.turns import nearest_heading
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, XD_BODY, YAW, YAW_RATE, YD_BODY, Array, heading_matrix

FARTHEST_M: Final = 1e3
MOST_TURNED_RAD: Final = 1e4
"""Poses beyond are not of a laboratory."""


class PoseEstimator(ABC):
    """An `Estimator` from poses; subclasses predict the estimate and update it by a pose.

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
        self._start(np.append(measurement.position_m, yaw_rad), np.zeros(INPUT_SIZE))

    def take_over(self, estimate: Estimate) -> None:
        """Start from another estimator's estimate of the present moment."""
        motion = estimate.motion
        self._yaw_known = self._actuators_known = True
        self._set_actuators(estimate.actuator)
        self._gate.open()
        self._start(motion[:INPUT_SIZE].copy(), _inertial_rates(motion))

    def predict(self, applied_input: Array, period_s: float) -> None:
        """Predict by one period, during which an input acted at the vehicle, shape (4,).

        Raises
        ------
        ValueError
            The input is not finite.
        """
        if not all(map(math.isfinite, applied_input.tolist())):
            raise ValueError(f"applied input {applied_input} is not finite")
        if not self._actuators_known:
            self._actuators_known = True
            self._set_actuators(applied_input)
        self._gate.wait(period_s)
        self._predict(applied_input, period_s)

    def correct(self, measurement: Measurement) -> bool:
        """Correct the estimate by a fresh, unoccluded pose of the instant up to which was predicted.

        Returns False if the pose was refused because the vehicle cannot have flown there.
        """
        if not _readable(measurement):
            self._gate.refuse_unreadable()
            return False
        if not self._yaw_known:
            self.reset(measurement)
            return True
        predicted = self._predicted_pose()
        yaw_rad = nearest_heading(measurement.yaw_rad, float(predicted[YAW]))
        pose = np.append(measurement.position_m, yaw_rad)
        verdict = self._gate.judge(pose, pose - predicted, self._deviation())
        if verdict.restart:
            rates = _inertial_rates(self.estimate.motion) if verdict.rates is None else verdict.rates
            self._start(pose, rates)
        elif verdict.accepted:
            self._update(pose)
        return verdict.accepted

    @abstractmethod
    def _set_actuators(self, applied_input: Array) -> None:
        """Set the actuator states to an input that has been acting for long, shape (4,)."""

    @abstractmethod
    def _start(self, pose: Array, rates: Array) -> None:
        """Start at a pose with inertial velocity and yaw rate, both of shape (4,)."""

    @abstractmethod
    def _predict(self, applied_input: Array, period_s: float) -> None:
        """Predict by one period."""

    def _predicted_pose(self) -> Array:
        """Return the pose that the next one is compared with."""
        return self.estimate.motion[:INPUT_SIZE]

    @abstractmethod
    def _deviation(self) -> Array:
        """Return the standard deviation of the next innovation, shape (4,)."""

    @abstractmethod
    def _update(self, pose: Array) -> None:
        """Correct by a pose that passed the gate."""


def body_motion(pose: Array, rates: Array) -> Array:
    """Return the motion state of a pose with inertial velocity and yaw rate, both of shape (4,)."""
    motion = np.concatenate((pose, rates))
    motion[XD_BODY : YD_BODY + 1] = heading_matrix(float(pose[YAW])).T @ rates[:2]
    return motion


def _inertial_rates(motion: Array) -> Array:
    """Inertial velocity and yaw rate of a motion state, shape (4,)."""
    rates = motion[XD_BODY : YAW_RATE + 1].copy()
    rates[:2] = heading_matrix(float(motion[YAW])) @ rates[:2]
    return rates


def _readable(measurement: Measurement) -> bool:
    # Comparisons with nan are false.
    inside = all(abs(coordinate) <= FARTHEST_M for coordinate in measurement.position_m.tolist())
    return inside and abs(measurement.yaw_rad) <= MOST_TURNED_RAD
