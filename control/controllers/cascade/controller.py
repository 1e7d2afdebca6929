"""Yaw-first cascade ("trajectory MPC"): the default controller (docs/formulas.md).

Three small quadratic programs per step. Yaw does not depend on the rest and comes first; the vertical does
not either and is solved beside it in the same workspace; along the planned yaw the horizontal motion is
exactly linear, time-varying. Together they are the paper's problem with the true dynamics in place of the
frozen ones, with actuator lags as states, estimated disturbances in the prediction and the inputs that fly
the reference as input reference.
"""

from collections.abc import Callable, Sequence
from typing import Annotated, ClassVar, Final

import msgspec
import numpy as np

from rcopterx.control.controllers.base import REFERENCE_YAW_CAP_RAD, PlanningController, Solution
from rcopterx.control.controllers.cascade.clearance import Clearances, clearances
from rcopterx.control.controllers.cascade.disturbance_observer import DisturbanceObserver
from rcopterx.control.controllers.cascade.lag_problem import LagProblem
from rcopterx.control.controllers.cascade.terms import (
    HorizontalProblem,
    HorizontalTask,
    let_come_back,
    riccati_cost,
)
from rcopterx.control.controllers.cascade.tilt_problem import TiltProblem
from rcopterx.control.controllers.cascade.weights import default_input_weights, default_state_weights
from rcopterx.control.controllers.cascade.within_bounds import StepWithinBounds
from rcopterx.control.controllers.chains.active_set import UNLIMITED, Budget
from rcopterx.control.controllers.chains.chain import ChainParameters, ChainTarget
from rcopterx.control.controllers.chains.chain_qp import ChainQP
from rcopterx.control.controllers.settings import ControllerSettings, EightWeights, FourWeights, Fraction
from rcopterx.control.interfaces import Estimate, LimitScale, Obstacle
from rcopterx.control.models.roll_out import lag_poles
from rcopterx.control.references.trajectory import COLUMNS, POSITION, Trajectory
from rcopterx.native.cascade import steady_problem
from rcopterx.native.plans import join_plans, turned_by_thrust
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_THRUST, Array

EffortFactor = Annotated[float, msgspec.Meta(ge=1.0, le=1e4)]

_FREE: Final = 1e9
"""Bound of a heading, which has none."""
COMING_BACK_S: Final = 0.2
"""Time constant with which a climb rate or yaw rate beyond its bounds comes back."""
SLOWING_S: Final = 0.1
"""Time constant with which a cascade of lowered bandwidth takes disturbances in, per root of the factor."""
_HORIZONTAL: Final = slice(0, 2)
_STEADY: Final = slice(2, 4)
"""The vertical and yaw among the four axes x, y, z, yaw: constant matrices, independent of all else."""


class CascadeSettings(ControllerSettings, frozen=True, kw_only=True):
    """Settings of the cascade."""

    state_weights: EightWeights | None = None
    """Diagonal of Q: x y z psi xd_B yd_B zd_B psid; by default from the vehicle's model."""
    input_weights: FourWeights | None = None
    """Diagonal of R: pitch, roll, thrust, yaw; by default from the model and its uncertainty."""
    effort_factors: tuple[EffortFactor, EffortFactor, EffortFactor] = (1.0, 1.0, 1.0)
    """Factors of the input weights of pitch and roll, of thrust and of yaw, and of how slowly the estimated
    disturbances of pitch, roll and yaw are taken in; the guard against oscillation raises them."""
    actuator_lag: bool = True
    """Model the actuators' lag."""
    feed_forward: bool = True
    """Input reference from the reference's accelerations; False refers inputs to hovering."""
    disturbance_compensation: bool = True
    """Predict with the estimated disturbance."""
    integrators: bool | None = None
    """Integral action; by default only while no disturbance is estimated or used."""
    input_range: Fraction = 1.0
    """Share of the input range around hovering to plan with; leaders leave their followers the rest."""
    soft_weight: Annotated[float, msgspec.Meta(gt=0.0, le=1e7)] = 1e5
    """Weight of the squared excess over a state bound, in SI units."""
    separation_weight: Annotated[float, msgspec.Meta(gt=0.0, le=1e8)] = 5e5
    """Weight of the squared excess over a separation constraint, in SI units."""
    avoidance: bool = True
    """Keep clear of the plans of other vehicles."""
    max_iterations: Annotated[int, msgspec.Meta(ge=1, le=200)] = 40
    """Interior-point steps in each problem before its best point is taken."""


class CascadeController(PlanningController):
    """Trajectory MPC, yaw first.

    Parameters
    ----------
    model
        The vehicle.
    period_s
        Control period T_s.
    settings
        Horizon, weights, bounds and switches.

    Raises
    ------
    SettingsError
        Bounds that the vehicle cannot have.
    """

    Settings = CascadeSettings
    workspace: ClassVar[type[ChainQP]] = ChainQP
    """Solver of the quadratic programs; benchmarks put peers in its place."""

    def __init__(self, model: Model, period_s: float, settings: CascadeSettings) -> None:
        super().__init__(model, period_s, settings.horizon, settings.limits(model))
        self._settings = settings
        horizontal, height, yaw = settings.effort_factors
        self._effort_factors = np.array([horizontal, horizontal, height, yaw])
        self._slowed = bool((self._effort_factors > 1.0).any())
        self._observer = DisturbanceObserver(model, period_s)
        self._decay = 1.0 + period_s * (np.array(model.direct_damping) if settings.actuator_lag else model.k)
        self._poles = lag_poles(model, period_s)
        self._thrust_pole = float(self._poles[U_THRUST])
        self._coupling = model.thrust_coupling if settings.actuator_lag else 0.0
        limits = self._limits
        self._joining = (
            self._coupling,
            self._thrust_pole,
            limits.input_min,
            limits.input_max,
            period_s,
        )
        """What `join_plans` takes besides plans."""
        self._steady_chain = steady = self._parameters(_STEADY, (True, False))
        self._steady = self.workspace(steady, settings.max_iterations)
        self._horizontal = self._horizontal_problem()
        self._obstacles: tuple[Obstacle, ...] = ()
        self._expired = UNLIMITED.expired
        self._steady_budget = Budget(self._late, self._planned_steady)
        self._horizontal_budget = Budget(self._late, self._planned_horizontal)
        self._actuator: Array = np.zeros(INPUT_SIZE)
        """Of the present estimate."""
        self._remaining = np.exp(-period_s / COMING_BACK_S * np.arange(self._horizon))
        # What was estimated while it oscillated is worth nothing, so this begins with none.
        self._taken_in: Array = np.zeros(INPUT_SIZE)
        decay = self._decay[_STEADY].copy()
        self._steady_decay = decay
        self._steady_target = ChainTarget.empty(self._horizon, 6, 2 * steady.levels)
        self._aim: Array = np.empty((self._horizon, COLUMNS))
        """The present reference within its bounds."""
        self._first, self._load = np.empty((steady.levels, 2)), np.empty(2)
        """State of the vertical and of yaw at stage 1, and what acts on them."""
        stages = self._horizon + steady.levels - 2
        turn, transition = np.tile(np.eye(2), (stages, 1, 1)), np.tile(np.diag(decay), (stages - 1, 1, 1))
        self._steady.set_matrices(turn, transition, riccati_cost(steady, decay))
        self.set_limit_scale(LimitScale(4 * (settings.input_range,)))

    def _horizontal_problem(self) -> HorizontalProblem:
        settings, parameters = self._settings, self._parameters(_HORIZONTAL, (True, True))
        if self._model.tilt is not None:
            return TiltProblem(
                self._model,
                parameters,
                settings.separation_weight,
                settings.max_iterations,
                settings.feed_forward,
                settings.disturbance_compensation,
            )
        return LagProblem(
            parameters,
            self._decay[_HORIZONTAL],
            self.workspace,
            settings.separation_weight,
            settings.max_iterations,
            settings.feed_forward,
        )

    def set_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Keep clear of these in the next step (`rcopterx.control.interfaces.AvoidsObstacles`)."""
        self._obstacles = tuple(obstacles) if self._settings.avoidance else ()

    def set_deadline(self, expired: Callable[[], bool]) -> None:
        """Stop the solvers of the next step in time (`rcopterx.control.interfaces.StopsEarly`)."""
        self._expired = expired

    def set_limit_scale(self, limit_scale: LimitScale) -> None:
        """Plan within a fraction of the vehicle's limits, from the next step on.

        The input fraction is what is left to accelerate with once the disturbance is balanced, because
        that is what followers must be able to do as well: a gust that carries a leader along does not make it
        faster, and one that brakes it is balanced with the rest of the range.
        """
        hover, limits = self._model.hover_input, self._limits
        positions = (np.append(limits.state_min[:3], -_FREE), np.append(limits.state_max[:3], _FREE))
        slower = np.array(limit_scale.rates)
        rates = (slower * limits.state_min[3:], slower * limits.state_max[3:])
        self._steady_bounds, self._horizontal_bounds = (
            np.array(
                (
                    np.concatenate((positions[0][axes], rates[0][axes], limits.input_min[axes])),
                    np.concatenate((positions[1][axes], rates[1][axes], limits.input_max[axes])),
                )
            )
            for axes in (_STEADY, _HORIZONTAL)
        )
        whole = np.array(limit_scale.inputs)
        part = np.where(whole < 1.0, whole, np.inf)
        share = np.array((part * (limits.input_min - hover), part * (limits.input_max - hover)))
        self._horizontal_share = share[:, _HORIZONTAL].copy()
        chain, target = self._steady_chain, self._steady_target
        vehicle = (
            self._steady_bounds,
            share[:, _STEADY].copy(),
            self._reference_min,
            self._reference_max,
            REFERENCE_YAW_CAP_RAD,
            self._model.gravity_m_s2,
            self._steady_decay,
            self._period_s,
            self._settings.feed_forward,
            *chain.dynamics,
            chain.gain,
        )
        self._steady_problem = *vehicle, self._aim, self._first, self._load, *target
        self._within_bounds = None
        if isinstance(self._horizontal, TiltProblem) and self.workspace is ChainQP:
            self._within_bounds = StepWithinBounds(
                self._steady,
                vehicle,
                self._horizontal,
                self._horizontal_bounds,
                self._horizontal_share,
                self._joining,
            )

    def _parameters(self, axes: slice, position_bounded: tuple[bool, bool]) -> ChainParameters:
        state, inputs = self._settings.state_weights, self._settings.input_weights
        weights = np.array(default_state_weights(self._model) if state is None else state)
        effort = np.array(default_input_weights(self._model, self._period_s) if inputs is None else inputs)
        effort *= self._effort_factors
        return ChainParameters(
            stages=self._horizon,
            period_s=self._period_s,
            gain=self._model.b[axes],
            pole=self._poles[axes] if self._settings.actuator_lag else None,
            rate_feedback=np.array(self._model.rate_feedback)[axes],
            position_weights=weights[:4][axes],
            velocity_weights=weights[4:][axes],
            input_weights=effort[axes],
            soft_weight=self._settings.soft_weight,
            position_bounded=position_bounded,
        )

    def _start(self, estimate: Estimate, last_input: Array) -> None:
        self._observer.start(estimate.motion, last_input)
        self._steady.forget()
        self._horizontal.forget()

    def _solve(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,  # noqa: ARG002 - changes of the input cost nothing here
    ) -> Solution:
        disturbance, within_bounds = self._disturbance(estimate), self._within_bounds
        if within_bounds is not None and not self._obstacles:
            planned = within_bounds.attempt(estimate, disturbance, reference.samples)
            if planned is not None:
                inputs, samples, steps = planned
                self._expired = UNLIMITED.expired
                return Solution(inputs, Trajectory(samples, self._period_s), steps)
        return self._solve_in_turn(estimate, disturbance, reference)

    def _solve_in_turn(self, estimate: Estimate, disturbance: Array, reference: Trajectory) -> Solution:
        """Solve one problem after the other, whatever that takes."""
        self._actuator = actuator = estimate.actuator
        within = steady_problem(
            estimate.motion, actuator, disturbance, reference.samples, *self._steady_problem
        )
        clear = self._clearances(estimate) if self._obstacles else None
        try:
            steady = self._steady.solve(
                self._first, self._load, self._bounded_target(clear, within), self._steady_budget
            )
            task = HorizontalTask(
                estimate, disturbance, steady.flat, self._aim, clear, self._horizontal_budget
            )
            horizontal = self._horizontal.solve(task, self._horizontal_bounds, self._horizontal_share)
        finally:
            self._expired = UNLIMITED.expired
        inputs, samples = np.empty((self._horizon - 1, INPUT_SIZE)), np.empty((self._horizon, COLUMNS))
        join_plans(
            horizontal.flat,
            steady.flat,
            horizontal.inputs,
            steady.inputs,
            actuator,
            *self._joining,
            inputs,
            samples,
        )
        return Solution(
            inputs,
            Trajectory(samples, self._period_s),
            horizontal.iterations + steady.iterations,
            not (horizontal.solved and steady.solved),
        )

    def _late(self) -> bool:
        """Whether the present step is to stop."""
        return self._expired()

    def _bounded_target(self, clear: Clearances | None, within: bool) -> ChainTarget:
        """The target of the vertical and of yaw, whose measured velocities may be within bounds or not."""
        target = self._steady_target
        if clear is not None:
            target = clear.bound_heights(target)
        return target if within else let_come_back(target, self._first[1], self._remaining)

    def _planned_horizontal(self) -> Array | None:
        """Pitch and roll of the previous plan."""
        planned = self._planned_inputs()
        return None if planned is None else planned[:, _HORIZONTAL]

    def _planned_steady(self) -> Array | None:
        """Thrust and yaw of the previous plan as inputs of their problem, in which thrust does not turn."""
        planned = self._planned_inputs()
        if planned is None:
            return None
        steady = planned[:, _STEADY].copy()
        actuator = self._actuator[U_THRUST]
        steady[:, 1] += turned_by_thrust(self._coupling, self._thrust_pole, actuator, steady[:, 0])
        return steady

    def _clearances(self, estimate: Estimate) -> Clearances:
        """Separation constraints around the previous plan."""
        own = self._last_plan
        if own is None:
            previous = np.tile(estimate.motion[:3], (self._horizon, 1))
        else:
            previous = own.positions_from(self._period_s, self._period_s, self._horizon)
        return clearances(previous, self._aim[:, POSITION], self._obstacles)

    def _disturbance(self, estimate: Estimate) -> Array:
        """Accelerations to predict with, in the order of `Estimate.disturbance`."""
        told = estimate.disturbance if self._settings.disturbance_compensation else np.zeros(4)
        if self._slowed:
            told = self._taken_in_slowly(told)
        integrate = self._settings.integrators
        if integrate is None:
            integrate = not any(told.tolist())
        if not integrate:
            return told
        if self._last_plan is not None:
            self._observer.observe(estimate.motion, self._last_plan)
        return np.asarray(told + self._observer.disturbance(estimate.motion))

    def _taken_in_slowly(self, told: Array) -> Array:
        """The estimated disturbance while the bandwidth is lowered: at once for the height alone."""
        factors = self._effort_factors
        time_constant_s = SLOWING_S * np.sqrt(factors)
        self._taken_in += self._period_s / (self._period_s + time_constant_s) * (told - self._taken_in)
        at_once = factors == 1.0
        at_once[U_THRUST] = True
        self._taken_in[at_once] = told[at_once]
        return self._taken_in.copy()
