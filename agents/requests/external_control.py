"""Control of a vehicle by an external program: given by request, lost by silence, landing or release.

At every period the program gets a task: the state in which the vehicle will be when the answer acts, and the
reference from then on. So the way to the program and back costs one period of prediction and no waiting.
While there is no answer, the vehicle's own controller flies (docs/control.md).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcopterx.agents.pilot import Pilot
from rcopterx.bus.external_messages import ControlTask, ExternalInput
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import Diagnostics
from rcopterx.bus.requests import TakeControl
from rcopterx.bus.subscription import Inbox
from rcopterx.control.interfaces import Controller, ControlStep, Estimate, never
from rcopterx.control.models.prediction import predict
from rcopterx.control.models.roll_out import predict as roll_out
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import Array, four


@dataclass(frozen=True, slots=True)
class ExternalTask:
    """What an external controller is to solve."""

    number: int  # counts control periods; the answer names it
    estimate: Estimate  # state at the instant the answer begins to act
    reference: Trajectory  # N stages from that instant on
    last_input: Array  # input that acts until then, shape (4,)


class ExternalController:
    """Control by answers from outside, `own` before and after `patience_s` without; fleet `clock` [s]."""

    def __init__(self, own: Controller, model: Model, patience_s: float, clock: Callable[[], float]) -> None:
        self.own, self.horizon, self.period_s = own, own.horizon, own.period_s
        self.task: ExternalTask | None = None
        self.late = 0  # steps flown by an older answer than the newest task's
        self._model, self._clock = model, clock
        self._patience = max(1, round(patience_s / own.period_s))
        self._number = self._answered = 0  # of the newest task, and of the one answered last
        self._task_s = clock()  # time of the newest task
        self._inputs: Array | None = None

    @property
    def silent(self) -> bool:
        """Whether nothing has come for longer than the patience."""
        return self._number - self._answered > self._patience

    def answer(self, number: int, inputs: Array) -> bool:
        """Accept planned inputs (k, 4) for task `number` if none has been answered since; return whether."""
        low, high = self._model.u_min, self._model.u_max
        within = ((inputs >= low - 1e-9) & (inputs <= high + 1e-9)).all()
        if not (within and self._answered < number <= self._number):
            return False
        self._answered, self._inputs = number, np.clip(inputs, low, high)
        return True

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Start from a flying vehicle."""
        self.own.reset(estimate, last_input)

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        """Fly by the newest answer, its later inputs if the task has moved on, and give out the next task."""
        now_s = self._clock()
        present = self._number + max(1, round((now_s - self._task_s) / self.period_s))
        if self._inputs is None:
            step = self.own.step(estimate, reference, last_input, expired)
        else:
            step = self._step_by(self._inputs, present - self._answered - 1, estimate)
        self._number, self._task_s = present, now_s
        self.task = ExternalTask(
            self._number,
            predict(self._model, estimate, step.inputs[0], self.period_s),
            reference.resampled(self.period_s, self.period_s, self.horizon),
            step.inputs[0],
        )
        return step

    def _step_by(self, answer: Array, stage: int, estimate: Estimate) -> ControlStep:
        """Return a step by the inputs of an answer from a stage on."""
        late = self._number > self._answered
        self.late += late
        inputs = answer[np.minimum(np.arange(self.horizon - 1) + stage, len(answer) - 1)]
        plan = roll_out(self._model, estimate, inputs, self.period_s)
        return ControlStep(inputs, plan, "external_late" if late else None, 0)


@dataclass
class ExternalControl:
    """The external program that flies a vehicle, if any; `publish` sends it its tasks."""

    pilot: Pilot
    answers: Inbox[ExternalInput]
    publish: Callable[[ControlTask], None]
    client: str = ""  # name of the program; empty without one

    def __post_init__(self) -> None:
        self._controller: ExternalController | None = None

    def take(self, request: TakeControl) -> str | None:
        """Give control to a client; return the reason of a refusal, or None."""
        phase = self.pilot.guidance.task.phase
        if phase is not Phase.FLYING:
            return f"a vehicle is handed over in flight, the phase is {phase}"
        if self.client not in ("", request.source):
            return f"{self.client} flies it already"
        self._return_control()
        self.answers.drain()
        self.client = request.source
        pilot = self.pilot
        self._controller = ExternalController(
            pilot.controller, pilot.model, request.patience_s, lambda: pilot.clock.time_s
        )
        self.pilot.use_controller(self._controller)
        return None

    def release(self, source: str) -> str | None:
        """End the control of a client; return the reason of a refusal, or None."""
        if self.client != source:
            return f"{self.client or 'no program'} flies it from outside, not {source}"
        self._return_control()
        return None

    def report(self, to: Diagnostics, now_s: float) -> None:  # noqa: ARG002 - see `Reports`
        """See `rcopterx.agents.reporting.Reports`."""
        to.client = self.client

    def before_control(self) -> None:
        """Process the inputs of the client; end its control if it is silent or not in free flight."""
        controller = self._controller
        for received in self.answers.drain():
            message = received.message
            if controller is None or message.source != self.client:
                self.answers.reject("source")
                continue
            if not controller.answer(message.number, message.inputs.to_numpy()):
                self.answers.reject("value")
        if controller is None:
            return
        event = self._end_of_control(controller)
        if event is not None:
            self.pilot.events[event] += 1
            self._return_control()

    def _end_of_control(self, controller: ExternalController) -> str | None:
        """Return the event that ends the control of the client; None if it flies on."""
        if self.pilot.step_guard.given_up:
            return "external_unsafe"
        if controller.silent:
            return "external_silent"
        return None if self.pilot.guidance.task.phase is Phase.FLYING else "external_ended"

    def after_control(self) -> None:
        """Publish the next task."""
        if self._controller is None or self._controller.task is None:
            return
        task, model, clock = self._controller.task, self.pilot.model, self.pilot.clock
        estimate = task.estimate
        self.publish(
            ControlTask(
                epoch=clock.epoch,
                frame=clock.current_frame,
                client=self.client,
                number=task.number,
                period_s=self._controller.period_s,
                motion=_eight(estimate.motion),
                actuator=four(estimate.actuator),
                disturbance=four(estimate.disturbance),
                reference=FloatArray.of(task.reference.samples),
                last_input=four(task.last_input),
                hover_input=four(model.hover_input),
                input_gain=four(model.b),
                input_min=four(model.u_min),
                input_max=four(model.u_max),
            )
        )

    def _return_control(self) -> None:
        if self._controller is not None:
            self.pilot.use_controller(self._controller.own)
        self._controller, self.client = None, ""


def _eight(values: Array) -> tuple[float, float, float, float, float, float, float, float]:
    a, b, c, d, e, f, g, h = values.tolist()
    return (a, b, c, d, e, f, g, h)
