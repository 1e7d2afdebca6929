"""What the controllers of this package have in common: sane numbers go into the law, limits hold after it.

A `PlanningController` remembers its plan. A `BaseController` is one around a control law: it cuts the
reference to what arithmetic can bear, lets the law compute, and cuts inputs to their limits. What happens
where a law finds nothing, raises or errs is up to the `StepGuard`.
"""

from abc import ABC, abstractmethod
from typing import Final

import numpy as np
from msgspec import Struct

from rcopterx.control.controllers.settings import Limits
from rcopterx.control.interfaces import ControlStep, Estimate, NoSolutionError
from rcopterx.control.models.roll_out import one_stage_on
from rcopterx.control.references.trajectory import YAW, Trajectory
from rcopterx.native.bounds import cut_reference, cut_rows, rows_within
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

EARLY_STOP: Final = "early_stop"
"""Counted for every step that is the best iterate of a solver that stopped before its tolerances were met."""

REFERENCE_YAW_CAP_RAD: Final = 60.0
"""A reference turns no farther away from the present heading."""


class Solution(Struct, frozen=True):
    """What a control law computed.

    Attributes
    ----------
    inputs
        Shape (N - 1, 4).
    plan
        N stages.
    iterations
        Solver iterations.
    early
        The solver stopped before its tolerances were met.
    """

    inputs: Array
    plan: Trajectory
    iterations: int
    early: bool = False


class PlanningController(ABC):
    """A `Controller` that remembers its plan.

    Parameters
    ----------
    model
        The vehicle.
    period_s
        Control period T_s.
    horizon
        Number of stages N.
    limits
        Bounds to plan with.
    """

    def __init__(self, model: Model, period_s: float, horizon: int, limits: Limits) -> None:
        self._model = model
        self._period_s = period_s
        self._horizon = horizon
        self._limits = limits
        span = limits.state_max - limits.state_min
        reach = np.concatenate((span[:3], [np.inf], 10 * span[3:6], [10 * span[6]], np.full(4, 100.0)))
        self._reference_min = np.concatenate((limits.state_min[:3], np.zeros(9))) - reach
        self._reference_max = np.concatenate((limits.state_max[:3], np.zeros(9))) + reach
        self._last_inputs: Array | None = None
        self._last_plan: Trajectory | None = None

    @property
    def horizon(self) -> int:
        """Number of stages N of references it expects and plans it returns."""
        return self._horizon

    @property
    def period_s(self) -> float:
        """Control period T_s."""
        return self._period_s

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Start from a flying vehicle: nothing of an earlier flight is remembered."""
        self._last_inputs = None
        self._last_plan = None
        self._start(estimate, self._usable_input(last_input))

    def step(self, estimate: Estimate, reference: Trajectory, last_input: Array) -> ControlStep:
        """Compute one control step (`rcopterx.control.interfaces.Controller.step`).

        Raises
        ------
        NoSolutionError
            The control law has nothing to offer that is better than the previous plan.
        """
        if len(reference.samples) != self._horizon or abs(reference.period_s - self._period_s) > 1e-9:
            reference = reference.resampled(0.0, self._period_s, self._horizon)
        solution = self._solve(estimate, reference, last_input)
        if solution is None:
            self._move_on()
            raise NoSolutionError
        inputs, plan = solution.inputs, solution.plan
        self._last_inputs, self._last_plan = inputs, plan
        return ControlStep(inputs, plan, EARLY_STOP if solution.early else None, solution.iterations)

    @abstractmethod
    def _start(self, estimate: Estimate, last_input: Array) -> None:
        """Set integral states and warm starts for a bumpless first step."""

    @abstractmethod
    def _solve(self, estimate: Estimate, reference: Trajectory, last_input: Array) -> Solution | None:
        """Compute inputs within their limits, and the plan; None if there is nothing to offer.

        The reference has N stages of this period; numbers may be beyond all reason.
        """

    def _planned_inputs(self) -> Array | None:
        """Inputs of the previous plan one stage on, shape (N - 1, 4); None if there is none."""
        return None if self._last_inputs is None else one_stage_on(self._last_inputs)

    def _move_on(self) -> None:
        """A period passes in which the previous plan is flown."""
        self._last_inputs = self._planned_inputs()
        if self._last_plan is not None:
            self._last_plan = self._last_plan.resampled(self._period_s, self._period_s, self._horizon)

    def _usable_input(self, last_input: Array) -> Array:
        if rows_within(last_input[None], self._model.u_min, self._model.u_max):
            return last_input.copy()
        if not np.isfinite(last_input).all():
            return self._model.hover_input
        return np.minimum(np.maximum(last_input, self._model.u_min), self._model.u_max)


class BaseController(PlanningController):
    """A `Controller` around a control law; parameters as of `PlanningController`."""

    @abstractmethod
    def _compute(self, estimate: Estimate, reference: Trajectory, last_input: Array) -> Solution | None:
        """Compute inputs and plan from finite numbers; None if there is nothing to offer."""

    def _solve(self, estimate: Estimate, reference: Trajectory, last_input: Array) -> Solution | None:
        samples, low, high = np.empty(reference.samples.shape), self._reference_min, self._reference_max
        cut_reference(reference.samples, estimate.motion[YAW], low, high, REFERENCE_YAW_CAP_RAD, samples)
        aim = Trajectory(samples, self._period_s)
        solution = self._compute(estimate, aim, self._usable_input(last_input))
        if solution is None:
            return None
        inputs = np.empty(solution.inputs.shape)
        cut_rows(solution.inputs, self._limits.input_min, self._limits.input_max, inputs)
        return Solution(inputs, solution.plan, solution.iterations, solution.early)
