"""What stands between a controller and its vehicle: whatever a controller does, there is a command.

A controller may be somebody else's. It may raise, return something that is no command, or not return in time.
Such a step is a failure. It is flown by the inputs of the last good step, one stage on, while these are young
enough, else by the default controller, else by a plain feedback law.
Failures that follow each other for `PATIENCE_S` mean that the controller is of no use; whoever steps it then
takes the default controller. A solver that finds nothing better than the previous plan has not failed, but
its step is flown in the same way.
"""

import sys
from collections import Counter
from collections.abc import Callable
from typing import Final

import numpy as np

from rcopterx.agents.guards.guarded_call import FailureKinds, GuardedCall
from rcopterx.agents.guards.time_limit import SOLVER_SHARE, STEP_SHARE, TimeLimit
from rcopterx.control.controllers.hovering import hovering_input
from rcopterx.control.interfaces import (
    NO_TILT,
    Controller,
    ControlStep,
    Estimate,
    NoSolutionError,
    StopsEarly,
)
from rcopterx.control.models.finite import is_finite
from rcopterx.control.models.roll_out import one_stage_on, predict
from rcopterx.control.references.trajectory import COLUMNS, POSITION, YAW, Trajectory, hold
from rcopterx.native.bounds import (
    INPUTS_BEYOND_LIMITS,
    MISSHAPEN,
    PLAN_BEYOND_REASON,
    flaw_of_answer,
    sound_question,
)
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_THRUST, Array

SHIFTED_PLAN: Final = "shifted_plan"
"""Counted for every step that the previous plan flew."""
SHIFTED_PLAN_LIMIT_S: Final = 0.3
"""A plan older than this says nothing about a vehicle that nobody has steered since."""
DEFAULT_CONTROLLER: Final = "default_controller"
"""Counted for every step that the default controller flew for one that failed."""
HOVER: Final = "hover"
"""Counted for every step that the feedback law flew, or that had no reference to fly."""
RAISED: Final = "controller_raised"
UNUSABLE: Final = "controller_unusable"
"""Counted for every result that was no command: wrong shape, not finite, outside the limits."""
LATE: Final = "controller_late"

PATIENCE_S: Final = 0.1
"""Failures in a row for so long mean that the controller is given up."""
FIRST_STEPS: Final = 5
FIRST_STEPS_FACTOR: Final = 4.0
"""The first steps load code and fill caches; they may take so many times as long."""

_TOLERANCE: Final = 1e-6
_LARGEST: Final = 1e6
_LARGEST_FLOAT: Final = sys.float_info.max
_ESTIMATE_CAP: Final = np.array([50.0, 50.0, 50.0, 1e6, 50.0, 50.0, 50.0, 100.0] + 4 * [2.0] + 4 * [100.0])
"""Motion, actuators, disturbance: numbers beyond these are no vehicle; cut, they keep arithmetic finite."""
_NUMBERS: Final = np.dtype(np.float64)


class StepGuard:
    """Steps controllers, and makes up for what they fail to do.

    Parameters
    ----------
    model
        The vehicle.
    default
        Takes the place of a controller that fails; None for the feedback law alone.
    limit
        Time that a step may take.

    Attributes
    ----------
    calls
        Counts and tells failures.
    """

    def __init__(
        self, model: Model, default: Controller | None = None, limit: TimeLimit | None = None
    ) -> None:
        self.default = default
        kinds = FailureKinds(RAISED, UNUSABLE, LATE)
        self.calls = GuardedCall(kinds, FIRST_STEPS, FIRST_STEPS_FACTOR, limit)
        self._model = model
        self._lowest, self._highest = model.u_min, model.u_max
        self._without_s = 0.0
        """Time since the last usable step."""
        self._failed_for_s = 0.0
        self._to_start = False
        """Whether the controller has to start anew before its next step."""
        self._default_flies = False
        self._inputs: Array | None = None
        self._plan: Trajectory | None = None
        self._aim: Trajectory | None = None
        """The last reference that was finite."""
        self._known: Controller | None = None
        self._early: StopsEarly | None = None
        self._solver_s = 0.0

    @property
    def events(self) -> Counter[str]:
        """Failures by kind."""
        return self.calls.failures

    @property
    def given_up(self) -> bool:
        """Whether the controller has failed for so long that another one is to fly."""
        return self._failed_for_s >= PATIENCE_S - _TOLERANCE

    def reset(self, controller: Controller, estimate: Estimate, last_input: Array) -> None:
        """Let a controller start from a flying vehicle."""
        self._failed_for_s = self._without_s = 0.0
        self.calls.begin()
        self._inputs = self._plan = self._aim = None
        self._default_flies = False
        self._to_start = not is_finite(estimate)
        if not self._to_start:
            self._start(controller, _capped(estimate), last_input)

    def step(
        self, controller: Controller, estimate: Estimate, reference: Trajectory, last_input: Array
    ) -> ControlStep:
        """Compute one control step with a controller, or without it.

        Returns
        -------
        ControlStep
            Finite and within the vehicle's limits; its `fallback` names what was flown in the place of a
            result that could not be used.
        """
        tilt = NO_TILT if estimate.tilt is None else estimate.tilt
        known, aimed = sound_question(
            estimate.motion,
            estimate.actuator,
            estimate.disturbance,
            tilt.core,
            tilt.servo,
            tilt.wind_m_s2,
            tilt.trim,
            _ESTIMATE_CAP,
            reference.samples,
            _LARGEST_FLOAT,
        )
        if not known:
            estimate = _capped(estimate)
        if aimed:
            self._aim = aim = reference
        else:
            aim = self._last_aim(estimate, controller)
        step = self._asked(controller, estimate, aim, last_input) if known or is_finite(estimate) else None
        if step is not None:
            self._failed_for_s = self._without_s = 0.0
            self._default_flies = False
            self._inputs, self._plan = step.inputs, step.plan
            return step if aim is reference else ControlStep(step.inputs, step.plan, HOVER, step.iterations)
        young = self._without_s < SHIFTED_PLAN_LIMIT_S - _TOLERANCE
        self._without_s += controller.period_s
        if self._inputs is not None and young:
            self._inputs = one_stage_on(self._inputs)
            return self._flown_by(self._inputs, SHIFTED_PLAN, estimate, aim, controller.period_s)
        return self._step_by_default(controller, estimate, aim, last_input)

    def tell(self, controller: Controller, message: Callable[[], None]) -> bool:
        """Tell a controller something besides its steps; what it raises is a failure, and told by False."""
        return self.calls.tell(type(controller).__name__, message)

    def _start(self, controller: Controller, estimate: Estimate, last_input: Array) -> None:
        self.tell(controller, lambda: controller.reset(estimate, last_input))

    def _last_aim(self, estimate: Estimate, controller: Controller) -> Trajectory:
        """In the place of a reference that is not finite: the last set point, else where the vehicle is."""
        known = self._aim
        place = np.nan_to_num(estimate.motion[:4]) if known is None else known.samples[-1, :4]
        return hold(place[POSITION], float(place[YAW]), controller.period_s, controller.horizon)

    def _asked(
        self, controller: Controller, estimate: Estimate, reference: Trajectory, last_input: Array
    ) -> ControlStep | None:
        """A step of the controller; None after a failure, or if its solver offers nothing."""
        if self._to_start:
            self._start(controller, estimate, last_input)
            self._to_start = False
        answer = self._attempt(controller, estimate, reference, last_input)
        if isinstance(answer, NoSolutionError):
            self._failed_for_s = 0.0
            return None
        if answer is None:
            # Nobody knows what it was in the middle of.
            self._to_start = True
            self._failed_for_s += controller.period_s
        return answer

    def _attempt(
        self, controller: Controller, estimate: Estimate, reference: Trajectory, last_input: Array
    ) -> ControlStep | NoSolutionError | None:
        """A usable step, what the solver says if it offers none, or None after a failure."""
        if controller is not self._known:
            self._meet(controller)
        calls, early = self.calls, self._early
        if early is not None:
            self._solver_s = calls.allowed_s(self._solver_share_s)
            early.set_deadline(self._solver_late)

        def question() -> ControlStep | NoSolutionError:
            try:
                return controller.step(estimate, reference, last_input)
            except NoSolutionError as nothing:
                return nothing

        answer = calls.attempt(self._name, self._step_share_s, question, self._problem)
        if answer is None or isinstance(answer, NoSolutionError):
            return answer
        return ControlStep(self._cut, answer.plan, answer.fallback, answer.iterations)

    def _meet(self, controller: Controller) -> None:
        """Ask a controller once what stays as it is: above all, asking for a protocol takes long."""
        self._early = controller if isinstance(controller, StopsEarly) else None
        self._name, self._period_s = type(controller).__name__, controller.period_s
        self._solver_share_s, self._step_share_s = SOLVER_SHARE * self._period_s, STEP_SHARE * self._period_s
        stages = controller.horizon
        self._inputs_shape, self._plan_shape = (stages - 1, INPUT_SIZE), (stages, COLUMNS)
        self._known = controller

    def _solver_late(self) -> bool:
        """Whether the solver of the present step is to stop."""
        return self.calls.limit.over(self._solver_s)

    def _problem(self, step: object) -> str | None:
        """What makes a result unusable; None if it can be flown, with the inputs that are kept as cut."""
        if isinstance(step, NoSolutionError):
            return None
        if not (isinstance(step, ControlStep) and isinstance(step.plan, Trajectory)):
            return f"a step is {type(step).__name__} and no ControlStep with a Trajectory for its plan"
        inputs, plan = step.inputs, step.plan
        self._cut = cut = np.empty(self._inputs_shape)
        try:
            found = flaw_of_answer(
                plan.samples, inputs, _LARGEST, self._lowest, self._highest, _TOLERANCE, cut
            )
        except (TypeError, ValueError):
            # The kernel takes nothing but arrays of 64-bit floats with rows and columns.
            wrong = self._misshapen(inputs, plan)
            if wrong is None:
                raise
            return wrong
        if found == MISSHAPEN:
            return self._misshapen(inputs, plan)
        if found == PLAN_BEYOND_REASON:
            return "the plan is not finite, or beyond all reason"
        if abs(plan.period_s - self._period_s) > _TOLERANCE:
            return f"stages of the plan are {plan.period_s:g} s apart, not {self._period_s:g} s"
        if found == INPUTS_BEYOND_LIMITS:
            return "inputs are not finite, or leave the limits of the vehicle"
        if not (step.fallback is None or isinstance(step.fallback, str)):
            return f"fallback is {step.fallback!r}, neither a name nor None"
        return None

    def _misshapen(self, inputs: object, plan: Trajectory) -> str | None:
        """What is wrong with the arrays of a result; None if nothing is."""
        kinds = ("inputs", inputs, self._inputs_shape), ("plan", plan.samples, self._plan_shape)
        for name, values, shape in kinds:
            if not isinstance(values, np.ndarray):
                return f"{name} are {type(values).__name__} and no array"
            if values.shape != shape or values.dtype != _NUMBERS:
                return f"{name} have shape {values.shape} of {values.dtype}, not {shape} of float64"
        return None

    def _step_by_default(
        self, failed: Controller, estimate: Estimate, reference: Trajectory, last_input: Array
    ) -> ControlStep:
        default = self.default
        if default is not None and default is not failed and is_finite(estimate):
            if not self._default_flies:
                self._start(default, estimate, last_input)
            step = self._attempt(default, estimate, reference, last_input)
            self._default_flies = step is not None
            if isinstance(step, ControlStep):
                self._plan = step.plan
                return ControlStep(step.inputs, step.plan, DEFAULT_CONTROLLER, step.iterations)
        inputs = np.tile(self._model.hover_input, (failed.horizon - 1, 1))
        if is_finite(estimate):
            inputs[0] = hovering_input(self._model, estimate.motion, reference.samples[0, :4])
        else:
            inputs[:, U_THRUST] = self._model.hover_thrust
        inputs = np.clip(inputs, self._model.u_min, self._model.u_max)
        return self._flown_by(inputs, HOVER, estimate, reference, failed.period_s)

    def _flown_by(
        self, inputs: Array, fallback: str, estimate: Estimate, reference: Trajectory, period_s: float
    ) -> ControlStep:
        """Inputs and where they lead; where the vehicle is not known, the previous plan goes on."""
        stages = len(inputs) + 1
        plan = predict(self._model, estimate, inputs, period_s) if is_finite(estimate) else None
        if plan is None or not np.isfinite(plan.samples).all():
            known = reference if self._plan is None else self._plan
            plan = known.resampled(0.0 if self._plan is None else period_s, period_s, stages)
        self._plan = plan
        return ControlStep(inputs, plan, fallback, 0)


def _capped(estimate: Estimate) -> Estimate:
    """Estimate within what arithmetic can bear."""
    values = np.concatenate((estimate.motion, estimate.actuator, estimate.disturbance))
    motion, actuator, disturbance = np.split(np.clip(values, -_ESTIMATE_CAP, _ESTIMATE_CAP), (8, 12))
    return Estimate(motion, actuator, disturbance, estimate.tilt)
