"""What the estimators of the package have in common: unwrapped yaw, the innovation gate, its counters."""

import math
from abc import ABC, abstractmethod

import numpy as np

from rcopterx.control.estimators.gate import InnovationGate, Sudden
from rcopterx.control.estimators.settings import EstimatorSettings
from rcopterx.control.interfaces import Estimate, Measurement
from rcopterx.control.references.turns import nearest_heading
from rcopterx.native.kalman import FARTHEST_M, MOST_TURNED_RAD
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, YAW, Array


class PoseEstimator(ABC):
    """An `Estimator` from poses; subclasses say how the estimate moves and how a pose is taken in.

    Yaw is unwrapped here and nowhere else: a measured yaw is taken as the one of its turns that is nearest to
    the prediction. The very first `predict` assumes that the actuators have settled on the input it is given,
    and `reset` keeps the actuator states, which do not depend on poses: so call `predict` in every period,
    on the floor too.

    Parameters
    ----------
    model
        The vehicle.
    settings
        Gate widths and limit.
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
        """Start at rest at a measured pose.

        Parameters
        ----------
        measurement
            Where. The yaw of the first one is taken as it is, later ones are unwrapped.

        Raises
        ------
        ValueError
            If the pose is not finite.
        """
        if not _readable(measurement):
            raise ValueError(f"cannot start at {measurement}: not a finite place in a laboratory")
        pose = np.array([*measurement.position_m, measurement.yaw_rad])
        if self._yaw_known:
            pose[YAW] = self._unwrapped(measurement.yaw_rad)
        self._yaw_known = True
        self._gate.open()
        self._start(pose, np.zeros(INPUT_SIZE))

    def take_over(self, estimate: Estimate) -> None:
        """Start from another estimator's estimate.

        Parameters
        ----------
        estimate
            Motion and actuators of the present moment.
        """
        motion = estimate.motion
        self._yaw_known = self._actuators_known = True
        self._settle(estimate.actuator)
        self._gate.open()
        self._start(motion[:INPUT_SIZE].copy(), _inertial_rates(motion))

    def predict(self, applied_input: Array, period_s: float) -> None:
        """Move the estimate on by one period.

        Parameters
        ----------
        applied_input
            Input that acted at the vehicle during the period, shape (4,).
        period_s
            Length of the period: a frame or a control period.

        Raises
        ------
        ValueError
            If the input is not finite.
        """
        if not all(map(math.isfinite, applied_input.tolist())):
            raise ValueError(f"applied input {applied_input} is not finite")
        if not self._actuators_known:
            self._actuators_known = True
            self._settle(applied_input)
        self._gate.wait(period_s)
        self._move(applied_input, period_s)

    def correct(self, measurement: Measurement) -> bool:
        """Take in a pose.

        Parameters
        ----------
        measurement
            A fresh, unoccluded pose of the instant up to which was predicted.

        Returns
        -------
        bool
            False if it was refused because the vehicle cannot have flown there.
        """
        if not _readable(measurement):
            self._gate.refuse_unreadable()
            return False
        if not self._yaw_known:
            self.reset(measurement)
            return True
        predicted = self._predicted_pose()
        yaw_rad = nearest_heading(measurement.yaw_rad, float(predicted[YAW]))
        pose = np.array((*measurement.position_m.tolist(), yaw_rad))
        innovation = pose - predicted
        deviation = self._deviation()
        if self._gate.passes(innovation, deviation):
            self._gate.open()
            sudden = self._gate.sudden(innovation, deviation)
            if sudden is Sudden.SHIFT:
                self._start(pose, _inertial_rates(self.estimate.motion))
            elif sudden is Sudden.NOT:
                self._take_in(innovation)
            return sudden is not Sudden.ALONE
        restart = self._gate.refuse(pose)
        if restart is None:
            return False
        self._start(pose, restart.rates)
        return True

    def _unwrapped(self, yaw_rad: float) -> float:
        return nearest_heading(yaw_rad, float(self.estimate.motion[YAW]))

    @abstractmethod
    def _settle(self, applied_input: Array) -> None:
        """Set the actuator states to an input that has been acting for long, shape (4,)."""

    @abstractmethod
    def _start(self, pose: Array, rates: Array) -> None:
        """Begin anew at a pose with inertial velocity and yaw rate, both of shape (4,)."""

    @abstractmethod
    def _move(self, applied_input: Array, period_s: float) -> None:
        """Predict one period."""

    def _predicted_pose(self) -> Array:
        """Position and yaw that the next pose is compared with, shape (4,)."""
        return self.estimate.motion[:INPUT_SIZE]

    @abstractmethod
    def _deviation(self) -> Array:
        """Standard deviation of the next innovation, shape (4,)."""

    @abstractmethod
    def _take_in(self, innovation: Array) -> None:
        """Correct by an innovation that passed the gate, shape (4,)."""


def body_motion(pose: Array, rates: Array) -> Array:
    """Motion state from a pose and its inertial rates.

    Parameters
    ----------
    pose
        Position [m] and yaw [rad], shape (4,).
    rates
        Inertial velocity [m/s] and yaw rate [rad/s], shape (4,).

    Returns
    -------
    Array
        Motion state of `rcopterx.vehicles.state`, shape (8,).
    """
    yaw, vx, vy = float(pose[YAW]), float(rates[0]), float(rates[1])
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([*pose, c * vx + s * vy, c * vy - s * vx, *rates[2:]])


def _inertial_rates(motion: Array) -> Array:
    """Inertial velocity and yaw rate of a motion state, shape (4,)."""
    c, s = math.cos(motion[YAW]), math.sin(motion[YAW])
    return np.array([c * motion[4] - s * motion[5], s * motion[4] + c * motion[5], *motion[6:8]])


def _readable(measurement: Measurement) -> bool:
    # Written so that a comparison with nan refuses.
    x, y, z = measurement.position_m.tolist()
    inside = abs(x) <= FARTHEST_M and abs(y) <= FARTHEST_M and abs(z) <= FARTHEST_M
    return inside and abs(measurement.yaw_rad) <= MOST_TURNED_RAD
