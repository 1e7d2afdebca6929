"""Yaw-first cascade ("trajectory MPC"): the default controller (docs/formulas.md).

Three optimal control problems per step. Heading and height depend on nothing else. Along the planned heading
the horizontal motion is exactly linear, time-varying. Together they are the paper's problem with the true
dynamics instead of the frozen ones, with lags or tilt as states, estimated disturbances in the prediction,
and the inputs that fly the reference as input reference.
"""

from collections.abc import Callable, Sequence
from typing import Annotated, Final

import msgspec
import numpy as np

from rcopterx.control.controllers.base import EARLY_STOP, BaseController
from rcopterx.control.controllers.cascade.axis import AxisProblem, CascadeTask, recovery
from rcopterx.control.controllers.cascade.clearance import Clearances, clearances
from rcopterx.control.controllers.cascade.lateral import LateralLags, LateralProblem, LateralTilt, with_tilt
from rcopterx.control.controllers.cascade.weights import HORIZONTAL, CascadeWeights, default_weights
from rcopterx.control.controllers.settings import EightWeights, FourWeights, Limits, MpcSettings
from rcopterx.control.interfaces import ControlStep, Estimate, Obstacle
from rcopterx.control.references.columns import POSITION, VELOCITY
from rcopterx.control.references.sampling import samples_through
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.control.solver.problem import Solver
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_THRUST, U_YAW, XD_BODY, YAW, Array, Z, turned_about_z

STEERING_SHARE: Final = 0.5
"""Least thrust of a helicopter over that of hovering: one that falls with its thrust off cannot right
itself, and oscillates from stop to stop once it has it back."""
TIME_CONSTANT_S: Final = 1.0
ACCELERATION_CAP: Final = np.array([0.6, 0.6, 1.5])  # largest disturbance, x, y, z [m/s^2]


def with_steering(limits: Limits, model: Model) -> Limits:
    """Return limits within which a helicopter keeps enough thrust to be steered."""
    if model.airframe != "coaxial":
        return limits
    lowest = limits.input_min.copy()
    lowest[U_THRUST] = max(lowest[U_THRUST], STEERING_SHARE * model.hover_input[U_THRUST])
    return limits._replace(input_min=lowest)


class DisturbanceObserver:
    """Constant inertial acceleration from departures from the plan."""

    def __init__(self, model: Model, period_s: float) -> None:
        self._model, self._period_s = model, period_s
        self._acceleration = np.zeros(3)

    def start(self, motion: Array, last_input: Array) -> None:
        """Start from the disturbance that the last input balances, which makes a switch bumpless."""
        body = -self._model.b[:3] * (last_input - self._model.hover_input)[:3]
        self._acceleration = np.clip(turned_about_z(body, motion[YAW]), -ACCELERATION_CAP, ACCELERATION_CAP)

    def observe(self, motion: Array, previous_plan: Trajectory) -> None:
        """Compare the velocity with what the previous step's plan had for this instant."""
        middle_rad = motion[YAW] + 0.5 * self._period_s * motion[-1]
        velocity = turned_about_z(motion[XD_BODY : XD_BODY + 3], middle_rad)
        surprise = (velocity - previous_plan.samples[1, VELOCITY]) / self._period_s
        self._acceleration += self._period_s / TIME_CONSTANT_S * surprise
        np.clip(self._acceleration, -ACCELERATION_CAP, ACCELERATION_CAP, out=self._acceleration)

    def disturbance(self, motion: Array) -> Array:
        """Return the disturbance in the order of `Estimate.disturbance`, shape (4,)."""
        return np.append(turned_about_z(self._acceleration, -motion[YAW]), 0.0)


EffortFactor = Annotated[float, msgspec.Meta(ge=1.0, le=1e4)]
SLOWING_S: Final = 0.1  # per root of the effort factor, of the low-pass filter of disturbances


class CascadeSettings(MpcSettings, frozen=True, kw_only=True):
    """Settings of the cascade."""

    state_weights: EightWeights | None = None
    """Diagonal of Q: x y z psi xd_B yd_B zd_B psid; by default from the vehicle's model."""
    input_weights: FourWeights | None = None
    """Diagonal of R: pitch, roll, thrust, yaw; by default from the model and its uncertainty."""
    effort_factors: tuple[EffortFactor, EffortFactor, EffortFactor] = (1.0, 1.0, 1.0)
    """Factors of the input weights of pitch and roll, of thrust and of yaw. Larger ones also slow the filter
    of the disturbances of pitch, roll and yaw down. The guard against oscillation raises them."""
    feed_forward: bool = True
    """Input reference from the reference's accelerations; False refers inputs to hovering."""
    disturbance_compensation: bool = True
    """Predict with the estimated disturbance."""
    integrators: bool | None = None
    """Integral action; by default only while no disturbance is estimated or used. It has no effect on the
    horizontal motion of a vehicle with a tilt model, whose estimator estimates the wind."""
    soft_weight: Annotated[float, msgspec.Meta(gt=0.0, le=1e7)] = 1e5
    """Weight of the squared excess over a state bound, in SI units."""
    separation_weight: Annotated[float, msgspec.Meta(gt=0.0, le=1e8)] = 5e5
    """Weight of the squared excess over a separation constraint, in SI units."""
    avoidance: bool = True
    """Keep clear of the plans of other vehicles."""


class CascadeController(BaseController):
    """Trajectory MPC, yaw first; `new_solver` makes other solvers than the one that the settings name.

    Raises `SettingsError`: bounds or weights that the vehicle cannot have.
    """

    Settings = CascadeSettings

    def __init__(
        self,
        model: Model,
        period_s: float,
        settings: CascadeSettings,
        new_solver: Callable[[], Solver] | None = None,
    ) -> None:
        super().__init__(model, period_s, settings.horizon, with_steering(settings.limits(model), model))
        self._settings = settings
        self._effort_factors = np.array(settings.effort_factors)[[0, 0, 1, 2]]
        stages = settings.horizon - 1
        self._slowed = bool((self._effort_factors > 1.0).any())
        self._recovery = recovery(period_s, stages)
        common = model, period_s, self._weights(), stages, settings.feed_forward
        self._heading, self._height = (AxisProblem(slice(axis, axis + 1), *common) for axis in (YAW, Z))
        self.horizontal: LateralProblem = (
            LateralLags(HORIZONTAL, *common) if model.tilt is None else LateralTilt(*common)
        )
        make = new_solver or settings.new_solver
        self._heading_solver, self._height_solver, self.horizontal_solver = make(), make(), make()
        self._observer = DisturbanceObserver(model, period_s)
        self._filtered_disturbance: Array = np.zeros(INPUT_SIZE)
        self._obstacles: tuple[Obstacle, ...] = ()

    def _weights(self) -> CascadeWeights:
        settings, model = self._settings, self._model
        states = np.array(settings.state_weights or default_weights(model, self.period_s).states)
        efforts = np.array(settings.input_weights or default_weights(model, self.period_s).inputs)
        return CascadeWeights(states[:4], states[4:], efforts * self._effort_factors, settings.soft_weight)

    def set_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Keep clear of these in the next step (`rcopterx.control.interfaces.AvoidsObstacles`)."""
        self._obstacles = tuple(obstacles) if self._settings.avoidance else ()

    def _start(self, estimate: Estimate, last_input: Array) -> None:
        self._observer.start(estimate.motion, last_input)
        self._filtered_disturbance[:] = self._compensated(estimate)
        self.horizontal.reset()
        for solver in (self._heading_solver, self._height_solver, self.horizontal_solver):
            solver.reset()

    def _compute(self, estimate: Estimate, reference: Trajectory, expired: Callable[[], bool]) -> ControlStep:
        task = self._task(estimate, reference.samples)
        clear = self._clearances(task) if self._obstacles else None
        heights = None if clear is None else clear.heights(task.limits.position[:, Z])[:, :-1]
        heading = self._heading_solver.solve(self._heading.problem(task), True, expired)
        height = self._height_solver.solve(self._height.problem(task, heights), True, expired)
        last_rad = heading.x[-1:, 0] + self.period_s * heading.x[-1, 1]
        headings = np.concatenate((heading.x[:, 0], last_rad))
        lateral = self.horizontal.along(headings, task)
        if clear is not None:
            lateral = clear.added_to(lateral, height.x[:, 0], self._settings.separation_weight)
        horizontal = self.horizontal_solver.solve(lateral, self.horizontal.same_cost, expired)
        inputs = np.concatenate((self.horizontal.sticks(horizontal, task), height.u, heading.u), axis=1)
        if self._model.thrust_coupling:
            inputs[:, U_YAW] -= self._model.thrust_coupling * (height.u[:, 0] - height.x[:-1, 2])
        flown = np.concatenate((horizontal.x[:, :2], height.x[:, :1], heading.x[:, :1]), axis=1)
        velocity = self.horizontal.velocity_at_end(horizontal, headings)
        at_end = np.array((*velocity, height.x[-1, 1], heading.x[-1, 1]))
        return ControlStep(
            inputs,
            Trajectory(samples_through(flown, at_end, self.period_s), self.period_s),
            None if heading.optimal and height.optimal and horizontal.optimal else EARLY_STOP,
            heading.iterations + height.iterations + horizontal.iterations,
        )

    def _task(self, estimate: Estimate, reference: Array) -> CascadeTask:
        """What the problems of this step depend on."""
        model, load = self._model, self._disturbance(estimate)
        if model.tilt is not None:
            estimate = with_tilt(model, estimate, load, self._settings.disturbance_compensation)
        load[U_THRUST] -= model.gravity_m_s2
        return CascadeTask(estimate, load, reference, self._limits, self._recovery)

    def _clearances(self, task: CascadeTask) -> Clearances:
        own = self._last_plan
        if own is None:
            previous = np.tile(task.estimate.motion[:3], (self.horizon, 1))
        else:
            previous = own.resampled(self.period_s, self.period_s, self.horizon).position_m
        return clearances(previous, task.reference[:, POSITION], self._obstacles)

    def _compensated(self, estimate: Estimate) -> Array:
        """Estimated disturbance to predict with, before the filter."""
        return (
            estimate.disturbance.copy() if self._settings.disturbance_compensation else np.zeros(INPUT_SIZE)
        )

    def _disturbance(self, estimate: Estimate) -> Array:
        """Accelerations to predict with, in the order of `Estimate.disturbance`."""
        estimated, integrators = self._compensated(estimate), self._settings.integrators
        if self._slowed:
            estimated = self._filtered(estimated)
        integrate = not estimated.any() if integrators is None else integrators
        if not integrate:
            return estimated
        if self._last_plan is not None:
            self._observer.observe(estimate.motion, self._last_plan)
        return np.asarray(estimated + self._observer.disturbance(estimate.motion))

    def _filtered(self, estimated: Array) -> Array:
        """Low-pass filter the disturbance of axes whose bandwidth is lowered; never that of the height."""
        time_constant_s = SLOWING_S * np.sqrt(self._effort_factors)
        share = self.period_s / (self.period_s + time_constant_s)
        share[self._effort_factors == 1.0] = 1.0
        share[U_THRUST] = 1.0
        self._filtered_disturbance += share * (estimated - self._filtered_disturbance)
        return self._filtered_disturbance.copy()
