"""What stands between a controller and its vehicle: whatever a controller does, there is a command.

A controller may be somebody else's. It may raise, return something that is no command, or not return in time.
Such a step is a failure. It is flown by the inputs of the last good step, one stage on, while these are young
enough, else by the default controller, else by a plain feedback law. Failures that follow each other
for `PATIENCE_S` mean that the controller is of no use; whoever steps it then takes the default controller.
"""

from collections import Counter
from collections.abc import Callable
from typing import Final

import numpy as np

from rcopterx.agents.controllers.base import HOVER, SHIFTED_PLAN, SHIFTED_PLAN_LIMIT_S
from rcopterx.agents.controllers.hovering import hovering_input
from rcopterx.agents.controllers.roll_out import predict
from rcopterx.agents.flight.time_limit import SOLVER_SHARE, STEP_SHARE, NoTimeLimit, OutOfTimeError, TimeLimit
from rcopterx.agents.interfaces import Controller, ControlStep, Estimate, StopsEarly
from rcopterx.agents.references.trajectory import COLUMNS, Trajectory
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, Array

DEFAULT_CONTROLLER: Final = "default_controller"
"""Counted for every step that the default controller flew for one that failed."""
RAISED: Final = "controller_raised"
UNUSABLE: Final = "controller_unusable"
"""Counted for every result that was no command: wrong shape, not finite, outside the limits."""
LATE: Final = "controller_late"

PATIENCE_S: Final = 0.1
"""Failures in a row for so long mean that the controller is given up."""
FIRST_STEPS: Final = 5
FIRST_STEPS_FACTOR: Final = 4.0
"""The first steps load code and fill caches; they may take so many times as long."""
LONGEST_TEXT: Final = 300

_TOLERANCE: Final = 1e-6
_LARGEST: Final = 1e6


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
    events
        Failures by kind.
    failure
        What the last failure was; empty before the first one.
    """

    def __init__(
        self, model: Model, default: Controller | None = None, limit: TimeLimit | None = None
    ) -> None:
        self.default = default
        self.events: Counter[str] = Counter()
        self.failure = ""
        self._model = model
        self.limit = NoTimeLimit() if limit is None else limit
        self._failed_for_s = 0.0
        self._steps = 0
        self._interrupted = False
        self._default_flies = False
        self._inputs: Array | None = None
        self._known: Controller | None = None
        self._early: StopsEarly | None = None

    @property
    def given_up(self) -> bool:
        """Whether the controller has failed for so long that another one is to fly."""
        return self._failed_for_s >= PATIENCE_S - _TOLERANCE

    def reset(self, controller: Controller, estimate: Estimate, last_input: Array) -> None:
        """Let a controller start from a flying vehicle."""
        self._failed_for_s, self._steps = 0.0, 0
        self._inputs, self._default_flies = None, False
        self._start(controller, estimate, last_input)

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
        if self._interrupted:
            self._start(controller, estimate, last_input)
        step = self._attempt(controller, estimate, reference, last_input)
        if step is not None:
            self._failed_for_s, self._default_flies = 0.0, False
            self._inputs = step.inputs
            return step
        young = self._failed_for_s < SHIFTED_PLAN_LIMIT_S
        self._failed_for_s += controller.period_s
        if self._inputs is not None and young:
            self._inputs = np.vstack((self._inputs[1:], self._inputs[-1:]))
            return self._flown_by(self._inputs, SHIFTED_PLAN, estimate, controller.period_s)
        return self._step_by_default(controller, estimate, reference, last_input)

    def tell(self, controller: Controller, message: Callable[[], None]) -> None:
        """Tell a controller something besides its steps; what it raises is a failure like any other."""
        try:
            message()
        except Exception as error:  # noqa: BLE001 - it may be somebody else's and raise anything
            self._note(RAISED, f"{_name(controller)}: {type(error).__name__}: {error}")

    def _start(self, controller: Controller, estimate: Estimate, last_input: Array) -> None:
        self._interrupted = False
        self.tell(controller, lambda: controller.reset(estimate, last_input))

    def _attempt(
        self, controller: Controller, estimate: Estimate, reference: Trajectory, last_input: Array
    ) -> ControlStep | None:
        """A usable step, or None after a failure, which is counted."""
        name, limit_s = _name(controller), STEP_SHARE * controller.period_s
        if controller is not self._known:
            # Asking for a protocol takes longer than most of what is done here, so it is done once.
            self._known = controller
            self._early = controller if isinstance(controller, StopsEarly) else None
        self._steps += 1
        if self._steps <= FIRST_STEPS:
            limit_s *= FIRST_STEPS_FACTOR
        try:
            if self._early is not None:
                # It keeps the time by itself, and its best iterate is worth more than no step.
                solver_s = SOLVER_SHARE / STEP_SHARE * limit_s
                self._early.set_deadline(lambda: self.limit.used_s() > solver_s)
                with self.limit.within(np.inf):
                    step = controller.step(estimate, reference, last_input)
            else:
                with self.limit.within(limit_s):
                    step = controller.step(estimate, reference, last_input)
                if self.limit.used_s() > limit_s:
                    raise OutOfTimeError
            problem = self._problem(step, controller)
            if problem is None:
                inputs = np.minimum(np.maximum(step.inputs, self._model.u_min), self._model.u_max)
                return ControlStep(inputs, step.plan, step.fallback, step.iterations)
            self._note(UNUSABLE, f"{name}: {problem}")
        except OutOfTimeError:
            self._interrupted = True
            self._note(LATE, f"{name}: a step took longer than {1e3 * limit_s:.0f} ms")
        except Exception as error:  # noqa: BLE001 - it may be somebody else's and raise anything
            self._interrupted = True
            self._note(RAISED, f"{name}: {type(error).__name__}: {error}")
        return None

    def _problem(self, step: object, controller: Controller) -> str | None:
        """What makes a result unusable; None if it can be flown."""
        if not (isinstance(step, ControlStep) and isinstance(step.plan, Trajectory)):
            return f"a step is {type(step).__name__} and no ControlStep with a Trajectory for its plan"
        inputs, samples = np.asarray(step.inputs), np.asarray(step.plan.samples)
        stages = controller.horizon
        for name, values, shape in (
            ("inputs", inputs, (stages - 1, INPUT_SIZE)),
            ("plan", samples, (stages, COLUMNS)),
        ):
            if values.shape != shape or values.dtype != np.float64:
                return f"{name} have shape {values.shape} of {values.dtype}, not {shape} of float64"
            if not (np.abs(values) <= _LARGEST).all():
                return f"{name} are not finite, or beyond all reason"
        if abs(step.plan.period_s - controller.period_s) > _TOLERANCE:
            return f"stages of the plan are {step.plan.period_s:g} s apart, not {controller.period_s:g} s"
        low, high = self._model.u_min - _TOLERANCE, self._model.u_max + _TOLERANCE
        if not ((inputs >= low) & (inputs <= high)).all():
            return "inputs leave the limits of the vehicle"
        if not (step.fallback is None or isinstance(step.fallback, str)):
            return f"fallback is {step.fallback!r}, neither a name nor None"
        return None

    def _step_by_default(
        self, failed: Controller, estimate: Estimate, reference: Trajectory, last_input: Array
    ) -> ControlStep:
        default = self.default
        if default is not None and default is not failed:
            if not self._default_flies:
                self._default_flies = True
                self._start(default, estimate, last_input)
            step = self._attempt(default, estimate, reference, last_input)
            if step is not None:
                return ControlStep(step.inputs, step.plan, DEFAULT_CONTROLLER, step.iterations)
        inputs = np.tile(self._model.hover_input, (failed.horizon - 1, 1))
        if estimate.is_finite:
            place = reference.samples[0, :4] if np.isfinite(reference.samples[0]).all() else None
            motion = estimate.motion
            inputs[0] = hovering_input(self._model, motion, motion[:4] if place is None else place)
        inputs = np.clip(inputs, self._model.u_min, self._model.u_max)
        return self._flown_by(inputs, HOVER, estimate, failed.period_s)

    def _flown_by(self, inputs: Array, fallback: str, estimate: Estimate, period_s: float) -> ControlStep:
        plan = predict(self._model, estimate, inputs, period_s)
        if not np.isfinite(plan.samples).all():
            plan = Trajectory(np.zeros((len(inputs) + 1, COLUMNS)), period_s)
        return ControlStep(inputs, plan, fallback, 0)

    def _note(self, kind: str, text: str) -> None:
        self.events[kind] += 1
        self.failure = text[:LONGEST_TEXT]


def _name(controller: Controller) -> str:
    return type(controller).__name__
