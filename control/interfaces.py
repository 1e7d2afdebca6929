"""Interfaces of estimators and controllers.

Write a class with the methods of `Controller` (or `Estimator`), register it under the entry-point group
`rcopterx.controllers` (or `rcopterx.estimators`), and it flies in the same fleet.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, Protocol, runtime_checkable

import numpy as np
from msgspec import Struct

from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, MOTION_SIZE, Array


def never() -> bool:
    """Return False: a deadline that does not expire."""
    return False


class Measurement(Struct, frozen=True):
    """One pose of the motion capture."""

    position_m: Array
    """Inertial frame, shape (3,)."""
    yaw_rad: float
    """Wrapped or unwrapped."""
    tilt: Array | None = None
    """Horizontal components of the body's upward axis in the inertial frame, shape (2,): a vehicle tilted
    forward accelerates forward. None where the tracker gives positions and headings only."""

    @classmethod
    def of_pose(cls, position_m: Sequence[float], quaternion_xyzw: Sequence[float]) -> "Measurement":
        """Return the measurement of a rigid body from position and unit quaternion."""
        x, y, z, w = quaternion_xyzw
        yaw_rad = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        return cls(np.array(position_m), yaw_rad, np.array((2 * (x * z + w * y), 2 * (y * z - w * x))))


class TiltEstimate(NamedTuple):
    """Estimated tilt of a vehicle with a tilt model (`rcopterx.vehicles.tilt`); else empty arrays."""

    core: Array
    """Core states of the tilt model, inertial frame, shape (n,)."""
    servo: Array
    """Pitch and roll stick after the servo's lag, trim included, body frame, shape (2,)."""
    wind_m_s2: Array
    """Horizontal acceleration by the wind, inertial frame, shape (2,)."""
    trim: Array
    """Offsets of the pitch and roll stick: at minus these the swash plate is level, shape (2,)."""


NO_TILT: Final = TiltEstimate(*4 * [np.empty(0)])


class Estimate(NamedTuple):
    """Estimated state of a vehicle at one instant, in arrays of 64-bit floats.

    Kernels take it as one argument of the type `rcopterx.control.models.prediction.ESTIMATE`.
    """

    motion: Array
    """Motion state of `rcopterx.vehicles.state`, shape (8,), yaw unwrapped."""
    actuator: Array
    """Inputs after their lag, shape (4,)."""
    disturbance: Array
    """Unmodelled accelerations: body x, body y, z [m/s^2], yaw [rad/s^2], shape (4,); zeros where none are
    estimated."""
    tilt: TiltEstimate = NO_TILT
    """Predicts better than the first two entries of actuator and disturbance, which are then what a
    first-order lag would need to explain the same acceleration."""

    @property
    def has_tilt(self) -> bool:
        """Whether the tilt is estimated."""
        return len(self.tilt.core) > 0


def at_rest(model: Model) -> Estimate:
    """Return the state of a vehicle that hovers at the origin, level and in still air."""
    tilt = NO_TILT
    if model.tilt is not None:
        tilt = TiltEstimate(np.zeros(model.tilt.dynamics().size), *3 * [np.zeros(2)])
    return Estimate(np.zeros(MOTION_SIZE), model.hover_input.copy(), np.zeros(INPUT_SIZE), tilt)


class Estimator(Protocol):
    """Estimates the state of a vehicle from poses and applied inputs."""

    def reset(self, measurement: Measurement) -> None:
        """Start at rest at a measured pose."""

    def take_over(self, estimate: Estimate) -> None:
        """Start from another estimator's estimate, in flight."""

    def predict(self, applied_input: Array, period_s: float) -> None:
        """Predict by one period during which `applied_input`, shape (4,), acted."""

    def correct(self, measurement: Measurement) -> bool:
        """Correct by a pose; False if it was refused because the vehicle cannot have flown there."""

    @property
    def estimate(self) -> Estimate:
        """The current estimate."""


@runtime_checkable
class EstimatesUncertainty(Protocol):
    """An estimator that estimates the deviation of its position, for display only."""

    def position_deviation_m(self) -> Array:
        """Standard deviations of the estimated position, inertial x, y, z, shape (3,)."""


class ControlStep(Struct, frozen=True):
    """Result of one control step."""

    inputs: Array
    """Planned inputs, shape (N - 1, 4); the first row is applied now. Always finite and within limits."""
    plan: Trajectory
    """Predicted trajectory from the compensated present on, N stages."""
    fallback: str | None
    """Why the optimum is not what is returned (`early_stop`, `shifted_plan`, `hover`), else None."""
    iterations: int
    """Solver iterations, summed over sub-problems."""


class NoSolutionError(Exception):
    """A controller found nothing better than its previous plan, which the vehicle then continues."""


class Controller(Protocol):
    """Computes inputs and a plan, finite and within the limits; the caller checks that."""

    @property
    def horizon(self) -> int:
        """Number of stages N of references it expects and plans it returns."""

    @property
    def period_s(self) -> float:
        """Control period T_s."""

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Start from a flying vehicle: integral states and warm starts are set for a bumpless first step."""

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        """Compute one control step.

        `estimate` is the state at the instant at which the new input begins to act (the delay is
        compensated), `reference` has N stages from that instant on, and `last_input`, shape (4,), is the
        input of the period before. A step should return the best result it has as soon as `expired` is true.
        Raises `NoSolutionError`: the previous plan is better than all that was found; any other exception is
        a failure.
        """


class Obstacle(Struct, frozen=True):
    """Another vehicle on its way, with the ellipsoid around it that is to stay free."""

    positions_m: Array
    """Its centre at the stages of the controller's horizon, inertial frame, shape (N, 3)."""
    half_axes_m: Array
    """Along x, y, z, at the same stages, shape (N, 3)."""


@runtime_checkable
class AvoidsObstacles(Protocol):
    """A controller that plans around other vehicles."""

    def set_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Keep clear of these from the next step on.

        Set before every step while there are obstacles, and to an empty sequence once there are none.
        """
