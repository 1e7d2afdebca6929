"""Control of a vehicle by an external program: given by request, lost by silence, landing or release."""

from collections.abc import Callable
from dataclasses import dataclass

from rcopterx.agents.pilot import Pilot
from rcopterx.bus.external_messages import ControlTask, ExternalInput
from rcopterx.bus.message import FloatArray
from rcopterx.bus.messages import Diagnostics
from rcopterx.bus.requests import TakeControl
from rcopterx.bus.subscription import Inbox
from rcopterx.control.controllers.external import ExternalController
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import Array, four


@dataclass
class ExternalControl:
    """The external program that flies a vehicle, if any; `publish` sends it its tasks."""

    vehicle: str
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
                self.answers.reject("source", f"{message.source} does not control {self.vehicle}")
                continue
            problem = controller.answer(message.number, message.inputs.to_numpy())
            if problem is not None:
                self.answers.reject("value", problem)
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
