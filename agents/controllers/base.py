"""What every controller's step has in common: it never raises and never returns an unusable command.

`GuardedController.step` checks what comes in, lets the control law compute, checks what comes out, and
climbs down the ladder of control.md section 8 when it must: best iterate (`early_stop`), previous plan
shifted by one stage (`shifted_plan`), hovering at the last set point (`hover`). The result reports the rung.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.agents.controllers.hovering import hovering_input
from rcopterx.agents.controllers.roll_out import predict
from rcopterx.agents.controllers.settings import Limits
from rcopterx.agents.interfaces import ControlStep, Estimate
from rcopterx.agents.references.trajectory import POSITION, YAW, Trajectory, hold
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_THRUST, Array

EARLY_STOP: Final = "early_stop"
SHIFTED_PLAN: Final = "shifted_plan"
HOVER: Final = "hover"

SHIFTED_PLAN_LIMIT_S: Final = 0.3
"""A plan older than this says nothing about a vehicle that nobody has steered since."""

_ESTIMATE_CAP: Final = np.array([50.0, 50.0, 50.0, 1e6, 50.0, 50.0, 50.0, 100.0] + 4 * [2.0] + 4 * [100.0])
"""Motion, actuators, disturbance: numbers beyond these are no vehicle; cut, they keep arithmetic finite."""
_REFERENCE_YAW_CAP_RAD: Final = 60.0


@dataclass(frozen=True, slots=True)
class Solution:
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


class GuardedController(ABC):
    """A `Controller` around a control law.

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
        self._set_point: Array | None = None
        self._last_inputs: Array | None = None
        self._last_plan: Trajectory | None = None
        self._shifted_for_s = 0.0

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
        self._set_point = None
        self._last_inputs = None
        self._last_plan = None
        self._shifted_for_s = 0.0
        if estimate.is_finite:
            self._start(_capped(estimate), self._usable_input(last_input))

    def step(self, estimate: Estimate, reference: Trajectory, last_input: Array) -> ControlStep:
        """Compute one control step (`rcopterx.agents.interfaces.Controller.step`)."""
        if not estimate.is_finite:
            return self._step_without_state()
        estimate = _capped(estimate)
        usable = self._usable_reference(reference, estimate)
        if usable is not None:
            self._set_point = usable.samples[-1, :4].copy()
        aim = self._hold_set_point(estimate) if usable is None else usable
        solution = self._compute(estimate, aim, self._usable_input(last_input))
        if solution is None or not self._is_sound(solution):
            return self._step_without_solution(estimate)
        self._shifted_for_s = 0.0
        fallback = HOVER if usable is None else EARLY_STOP if solution.early else None
        return self._deliver(solution.inputs, solution.plan, fallback, solution.iterations)

    @abstractmethod
    def _start(self, estimate: Estimate, last_input: Array) -> None:
        """Set integral states and warm starts for a bumpless first step."""

    @abstractmethod
    def _compute(self, estimate: Estimate, reference: Trajectory, last_input: Array) -> Solution | None:
        """Compute inputs and plan from finite numbers; None if there is nothing to offer."""

    def _hover_inputs(self, estimate: Estimate) -> Array:
        """Inputs that bring the vehicle to rest at the set point, held over the horizon; shape (N - 1, 4)."""
        model, motion = self._model, estimate.motion
        first = hovering_input(model, motion, motion[:4] if self._set_point is None else self._set_point)
        inputs = np.tile(model.hover_input, (self._horizon - 1, 1))
        inputs[0] = np.clip(first, self._limits.input_min, self._limits.input_max)
        return inputs

    def _usable_reference(self, reference: Trajectory, estimate: Estimate) -> Trajectory | None:
        """Reference with N stages of this period and sane numbers; None if it is not finite."""
        samples = reference.samples
        if not (len(samples) and np.isfinite(samples).all()):
            return None
        if len(samples) != self._horizon or abs(reference.period_s - self._period_s) > 1e-9:
            reference = reference.resampled(0.0, self._period_s, self._horizon)
        lower, upper = self._reference_min, self._reference_max
        yaw = estimate.motion[YAW]
        lower[YAW], upper[YAW] = yaw - _REFERENCE_YAW_CAP_RAD, yaw + _REFERENCE_YAW_CAP_RAD
        return Trajectory(np.minimum(np.maximum(reference.samples, lower), upper), self._period_s)

    def _usable_input(self, last_input: Array) -> Array:
        if not np.isfinite(last_input).all():
            return self._model.hover_input
        return np.minimum(np.maximum(last_input, self._model.u_min), self._model.u_max)

    def _hold_set_point(self, estimate: Estimate) -> Trajectory:
        place = estimate.motion[:4] if self._set_point is None else self._set_point
        return hold(place[POSITION], float(place[YAW]), self._period_s, self._horizon)

    def _is_sound(self, solution: Solution) -> bool:
        return bool(np.isfinite(solution.inputs).all() and np.isfinite(solution.plan.samples).all())

    def _shifted_inputs(self) -> Array | None:
        """Inputs of the previous plan one stage on; None if there is none or it is too old."""
        if self._last_inputs is None or self._shifted_for_s >= SHIFTED_PLAN_LIMIT_S:
            return None
        return np.vstack((self._last_inputs[1:], self._last_inputs[-1:]))

    def _step_without_solution(self, estimate: Estimate) -> ControlStep:
        inputs, fallback = self._shifted_inputs(), SHIFTED_PLAN
        if inputs is None:
            inputs, fallback = self._hover_inputs(estimate), HOVER
        else:
            self._shifted_for_s += self._period_s
        return self._deliver(inputs, predict(self._model, estimate, inputs, self._period_s), fallback, 0)

    def _step_without_state(self) -> ControlStep:
        inputs, fallback = self._shifted_inputs(), SHIFTED_PLAN
        if inputs is None or self._last_plan is None:
            place = np.zeros(4) if self._set_point is None else self._set_point
            plan = hold(place[POSITION], float(place[YAW]), self._period_s, self._horizon)
            return self._deliver(np.tile(self._hover_command(), (self._horizon - 1, 1)), plan, HOVER, 0)
        self._shifted_for_s += self._period_s
        plan = self._last_plan.resampled(self._period_s, self._period_s, self._horizon)
        return self._deliver(inputs, plan, fallback, 0)

    def _hover_command(self) -> Array:
        command = self._model.hover_input.copy()
        command[U_THRUST] = self._model.hover_thrust
        return command

    def _deliver(self, inputs: Array, plan: Trajectory, fallback: str | None, iterations: int) -> ControlStep:
        within = np.minimum(np.maximum(inputs, self._limits.input_min), self._limits.input_max)
        self._last_inputs, self._last_plan = within, plan
        return ControlStep(within, plan, fallback, iterations)


def _capped(estimate: Estimate) -> Estimate:
    """Estimate within what arithmetic can bear; the same object in every real flight."""
    values = np.concatenate((estimate.motion, estimate.actuator, estimate.disturbance))
    if (np.abs(values) <= _ESTIMATE_CAP).all():
        return estimate
    motion, actuator, disturbance = np.split(np.clip(values, -_ESTIMATE_CAP, _ESTIMATE_CAP), (8, 12))
    return Estimate(motion, actuator, disturbance, estimate.tilt)
