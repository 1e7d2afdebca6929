"""The ladder of fallbacks between a controller and its vehicle: there is a command in every control period.

A controller may be a plug-in. It may raise, return something that is no command, not return in time, or leave
the flight envelope. Such a step is a failure. It is flown by the inputs of the last good step, one stage on,
while these are young enough, else by the default controller, else by a plain feedback law. Outside the
envelope the default controller flies at once. Failures that follow each other for `PATIENCE_S` mean that the
controller is of no use; the pilot then changes to the default controller. A solver that finds nothing better
than the previous plan has not failed, but its step is flown in the same way.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeVar, TypeVarTuple

import numpy as np
from msgspec.structs import replace

from rcopterx.agents.guards.envelope import Envelope
from rcopterx.agents.guards.time_limit import SOLVER_SHARE, STEP_SHARE, GuardedCall
from rcopterx.control.interfaces import (
    AvoidsObstacles,
    Controller,
    ControlStep,
    Estimate,
    NoSolutionError,
    Obstacle,
)
from rcopterx.control.models.prediction import is_finite
from rcopterx.control.models.roll_out import predict
from rcopterx.control.plugins import is_built_in
from rcopterx.control.references.columns import COLUMNS, POSE, POSITION
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.control.solver.active_set import shift
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_THRUST, XD_BODY, YAW, Array, turned_about_z

T = TypeVar("T")
Arguments = TypeVarTuple("Arguments")

SHIFTED_PLAN: Final = "shifted_plan"  # counted for every step that the previous plan flew
SHIFTED_PLAN_LIMIT_S: Final = 0.3  # age from which a plan shows nothing about an unsteered vehicle
DEFAULT_CONTROLLER: Final = "default_controller"  # counted for its steps in the place of one that failed
HOVER: Final = "hover"  # counted for every step that the feedback law flew, or that had no reference to fly

BRIDGED_S: Final = 0.18  # duration of the planned inputs that go with a command
PATIENCE_S: Final = 0.1  # failures in a row for so long mean that the controller is given up
FIRST_STEPS: Final = 5
FIRST_STEPS_FACTOR: Final = 4.0  # for first steps, which load code and fill caches

_STIFFNESS: Final = np.array([2.0, 2.0, 4.0, 9.0])
_DAMPING: Final = np.array([2.5, 2.5, 4.0, 6.0])
_ERROR_CAP: Final = np.array([0.4, 0.4, 0.4, 0.8])
"""Of `hovering_input`: per square second, per second, and largest errors; x, y, z, yaw."""
_TOLERANCE: Final = 1e-6
_LARGEST: Final = 1e6
_ESTIMATE_CAP: Final = np.array([50.0, 50.0, 50.0, 1e6, 50.0, 50.0, 50.0, 100.0] + 4 * [2.0] + 4 * [100.0])
"""Motion, actuators, disturbance: no vehicle is beyond these; estimates are cut to keep arithmetic finite."""


def hovering_input(model: Model, motion: Array, set_point: Array) -> Array:
    """Input, shape (4,), not limited, that brings motion, shape (8,), to rest at x, y, z [m], yaw [rad]."""
    error = np.clip(motion[:4] - set_point, -_ERROR_CAP, _ERROR_CAP)
    error = turned_about_z(error, -float(motion[YAW]))
    acceleration = -_STIFFNESS * error - _DAMPING * motion[XD_BODY:]
    return np.asarray(model.hover_input + acceleration / model.b)


class _Task(NamedTuple):
    """What one step has to fly."""

    estimate: Estimate
    reference: Trajectory
    last_input: Array
    known: bool  # whether the estimate is finite
    periods: int  # since the last step


class StepGuard:
    """Steps a controller, and replaces steps that fail; counts failures in `events`."""

    def __init__(
        self,
        model: Model,
        controller: Controller,
        default: Controller | None = None,
        events: Counter[str] | None = None,
    ) -> None:
        self.default = default  # flies for a controller that fails; None for the feedback law alone
        self.calls = GuardedCall("controller", FIRST_STEPS, FIRST_STEPS_FACTOR, events)
        """A result is unusable if it has a wrong shape, is not finite or beyond limits."""
        self.model = model
        self.neighbours: Sequence[Obstacle] = ()  # vehicles that may come near
        self._exchange_failed = False  # since the last step
        self._left_out = 0  # control periods without a step since the last one
        self._age_s = 0.0  # time since the last usable step
        self._failed_for_s = 0.0
        self._needs_reset = False  # whether the controller has to be reset before its next step
        self._default_flies = False
        self._inputs: Array | None = None  # inputs of the last usable step, shifted to the present
        self._plan: Trajectory | None = None  # plan that was flown last
        self._reference: Trajectory | None = None  # the last reference that was finite
        self.use(controller)

    @property
    def given_up(self) -> bool:
        """Whether the controller has failed for so long that another one is to fly."""
        return self._failed_for_s >= PATIENCE_S - _TOLERANCE

    def use(self, controller: Controller) -> None:
        """Change to another controller; one that is not part of this package stays in the flight envelope."""
        self.controller = controller
        self.avoiding = controller if isinstance(controller, AvoidsObstacles) else None
        """The controller if it plans around other vehicles."""
        self._obstructed = True  # whether it may have obstacles
        self.replaced = False  # whether the default one flies for one that failed
        self.calls.failure, self._failed_for_s = "", 0.0
        self._envelope = None if is_built_in(controller) else Envelope(self.model, BRIDGED_S)

    def use_default(self) -> bool:
        """Replace the controller by the default one; False if that is in use, or there is none."""
        if self.default is None or self.controller is self.default:
            return False
        failure = self.calls.failure
        self.use(self.default)
        self.calls.failure, self.replaced = failure, True
        return True

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Reset the controller to a flying vehicle."""
        self._failed_for_s = self._age_s = 0.0
        self._left_out = 0
        self.calls.begin()
        self._inputs = self._plan = self._reference = None
        self._default_flies = False
        self._needs_reset = not is_finite(estimate)
        if not self._needs_reset:
            self._reset(self.controller, _capped(estimate), last_input)

    def leave_out(self) -> None:
        """Pass a control period without a step; an input that was planned for it flies."""
        self._left_out += 1

    def step(self, estimate: Estimate, reference: Trajectory, last_input: Array) -> ControlStep:
        """Return one finite control step within the limits; `fallback` names what flew instead, if any."""
        task = self._task(estimate, reference, last_input)
        step = self._controller_step(task)
        if step is not None:
            self._failed_for_s = self._age_s = 0.0
            self._default_flies = False
            self._inputs, self._plan = step.inputs, step.plan
            return step if task.reference is reference else replace(step, fallback=HOVER)
        step = self._shifted_step(task) or self._default_step(task) or self._hover_step(task)
        self._plan = step.plan
        return step

    def set_obstacles(self, obstacles: Sequence[Obstacle]) -> None:
        """Pass obstacles to the controller, if it plans around other vehicles and they are not none again."""
        if self.avoiding is not None and (obstacles or self._obstructed):
            self._obstructed = bool(obstacles)
            self.calls.try_call(type(self.controller).__name__, self.avoiding.set_obstacles, obstacles)

    def try_exchange(
        self, share: float, exchange: Callable[[*Arguments], T], *arguments: *Arguments
    ) -> T | None:
        """Call a scheme in a share of the time of a step; None if it fails. Then its next step fails, too."""
        limit_s = share * STEP_SHARE * self.controller.period_s
        name = type(self.controller).__name__
        result = self.calls.attempt(name, limit_s, lambda _: None, exchange, *arguments)
        self._exchange_failed |= result is None
        return result

    def _reset(self, controller: Controller, estimate: Estimate, last_input: Array) -> None:
        self.calls.try_call(type(controller).__name__, controller.reset, estimate, last_input)

    def _task(self, estimate: Estimate, reference: Trajectory, last_input: Array) -> _Task:
        """Return what to fly; a reference that is not finite is replaced by the last set point or place."""
        estimate = _capped(estimate)
        if len(reference.samples) and np.isfinite(reference.samples).all():
            self._reference = reference
        else:
            known = self._reference
            place = np.nan_to_num(estimate.motion[:4]) if known is None else known.samples[-1, POSE]
            period_s, horizon = self.controller.period_s, self.controller.horizon
            reference = hold(place[POSITION], float(place[YAW]), period_s, horizon)
        periods, self._left_out = 1 + self._left_out, 0
        return _Task(estimate, reference, last_input, is_finite(estimate), periods)

    def _controller_step(self, task: _Task) -> ControlStep | None:
        """Return a step of the controller; None after a failure, or if its solver finds none."""
        if not task.known:
            return None
        if self._needs_reset:
            self._reset(self.controller, task.estimate, task.last_input)
            self._needs_reset = False
        result = None if self._exchange_failed else self._attempt(self.controller, task)
        self._exchange_failed = False
        if isinstance(result, NoSolutionError):
            self._failed_for_s = 0.0
            return None
        if result is not None and self._envelope is not None:
            result = self._within(self._envelope, task, result)
        if result is None:
            # Its state may be inconsistent.
            self._needs_reset = True
            self._failed_for_s += task.periods * self.controller.period_s
        return result

    def _within(self, envelope: Envelope, task: _Task, step: ControlStep) -> ControlStep | None:
        """Return a step with the plan that its inputs fly; None, and no earlier inputs, if that is unsafe."""
        plan = predict(self.model, task.estimate, step.inputs, self.controller.period_s)
        problem = envelope.problem(plan, self.neighbours)
        if problem is None:
            return replace(step, plan=plan)
        self.calls.note("unsafe", f"{type(self.controller).__name__}: {problem}")
        self._inputs = None
        return None

    def _shifted_step(self, task: _Task) -> ControlStep | None:
        """Return the inputs of the last usable step at the present stage; None if they are too old."""
        self._age_s += task.periods * self.controller.period_s
        if self._inputs is None or self._age_s > SHIFTED_PLAN_LIMIT_S + _TOLERANCE:
            return None
        for _ in range(task.periods):
            self._inputs = shift(self._inputs)
        return self._with_plan(self._inputs, SHIFTED_PLAN, task)

    def _default_step(self, task: _Task) -> ControlStep | None:
        """Return a step of the default controller; None if there is none."""
        default = self.default
        if default is None or default is self.controller or not task.known:
            return None
        if not self._default_flies:
            self._reset(default, task.estimate, task.last_input)
        if isinstance(default, AvoidsObstacles):
            default.set_obstacles(self.neighbours)
        result = self._attempt(default, task)
        self._default_flies = result is not None
        return replace(result, fallback=DEFAULT_CONTROLLER) if isinstance(result, ControlStep) else None

    def _hover_step(self, task: _Task) -> ControlStep:
        """Return the inputs of a plain feedback law, or those that carry a vehicle of unknown motion."""
        inputs = np.tile(self.model.hover_input, (self.controller.horizon - 1, 1))
        if task.known:
            inputs[0] = hovering_input(self.model, task.estimate.motion, task.reference.samples[0, POSE])
        else:
            inputs[:, U_THRUST] = self.model.hover_thrust
        return self._with_plan(self._limited(inputs), HOVER, task)

    def _with_plan(self, inputs: Array, fallback: str, task: _Task) -> ControlStep:
        """Return inputs and their prediction; for an unknown motion the previous plan goes on."""
        stages, period_s = len(inputs) + 1, self.controller.period_s
        plan = predict(self.model, task.estimate, inputs, period_s) if task.known else None
        if plan is None or not np.isfinite(plan.samples).all():
            known = task.reference if self._plan is None else self._plan
            passed_s = 0.0 if self._plan is None else task.periods * period_s
            plan = known.resampled(passed_s, period_s, stages)
        return ControlStep(inputs, plan, fallback, 0)

    def _attempt(self, controller: Controller, task: _Task) -> ControlStep | NoSolutionError | None:
        """Return a usable step, the exception of a solver without solution, or None after a failure."""
        limit = self.calls.limit
        solver_limit_s = self.calls.allowed_s(SOLVER_SHARE * controller.period_s)
        result = self.calls.attempt(
            type(controller).__name__,
            STEP_SHARE * controller.period_s,
            lambda result: self._problem(result, controller.horizon, controller.period_s),
            _stepped,
            controller,
            task,
            lambda: limit.over(solver_limit_s),
        )
        if isinstance(result, ControlStep):
            return replace(result, inputs=self._limited(result.inputs))
        return result

    def _limited(self, inputs: Array) -> Array:
        """Return inputs within the limits of the vehicle."""
        return np.clip(inputs, self.model.u_min, self.model.u_max)

    def _problem(self, step: object, stages: int, period_s: float) -> str | None:
        """Return the reason why a result cannot be flown; None if it can."""
        if isinstance(step, NoSolutionError):
            return None
        if not (isinstance(step, ControlStep) and isinstance(step.plan, Trajectory)):
            return f"a step is {type(step).__name__} and no ControlStep with a Trajectory for its plan"
        inputs, plan = step.inputs, step.plan
        misshapen = _misshapen("inputs", inputs, (stages - 1, INPUT_SIZE)) or _misshapen(
            "plan", plan.samples, (stages, COLUMNS)
        )
        if misshapen is not None:
            return misshapen
        if not (np.abs(plan.samples) <= _LARGEST).all():
            return "the plan is not finite, or beyond all reason"
        if abs(plan.period_s - period_s) > _TOLERANCE:
            return f"stages of the plan are {plan.period_s:g} s apart, not {period_s:g} s"
        if not np.abs(inputs - self._limited(inputs)).max() <= _TOLERANCE:
            return "inputs are not finite, or leave the limits of the vehicle"
        if not (step.fallback is None or isinstance(step.fallback, str)):
            return f"fallback is {step.fallback!r}, neither a name nor None"
        return None


def _stepped(
    controller: Controller, task: _Task, expired: Callable[[], bool]
) -> ControlStep | NoSolutionError:
    try:
        return controller.step(task.estimate, task.reference, task.last_input, expired)
    except NoSolutionError as error:
        return error


def _misshapen(name: str, values: object, shape: tuple[int, int]) -> str | None:
    if not isinstance(values, np.ndarray):
        return f"{name} are {type(values).__name__} and no array"
    if values.shape != shape or values.dtype != np.float64:
        return f"{name} have shape {values.shape} of {values.dtype}, not {shape} of float64"
    return None


def _capped(estimate: Estimate) -> Estimate:
    values = np.concatenate((estimate.motion, estimate.actuator, estimate.disturbance))
    if (np.abs(values) <= _ESTIMATE_CAP).all():
        return estimate
    motion, actuator, disturbance = np.split(np.clip(values, -_ESTIMATE_CAP, _ESTIMATE_CAP), (8, 12))
    return Estimate(motion, actuator, disturbance, estimate.tilt)
