"""Control from outside in the agent: it ends by silence, and by inputs that leave the flight envelope."""

import numpy as np
import pytest
from support.flight import ExactEstimator, Plant, measured, still
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.agents.flight.guidance import Guidance
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.requests.external_control import ExternalControl
from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.external_messages import ControlTask, ExternalInput
from rcopterx.bus.message import FloatArray
from rcopterx.bus.requests import TakeControl
from rcopterx.bus.subscription import Inbox
from rcopterx.control.interfaces import Estimate
from rcopterx.control.plugins import CONTROLLERS
from rcopterx.vehicles.state import U_THRUST, Array

PERIOD_S = 0.02
HOVER = COAXIAL_LAG.hover_input
PLACE_M = (0.0, 0.0, 1.0)


class Flight:
    """A vehicle that hovers, and a program outside."""

    def __init__(self) -> None:
        own, default = (CONTROLLERS.build("pid", COAXIAL_LAG, PERIOD_S, {"horizon": 20}) for _ in range(2))
        self.own = own
        self.pilot = Pilot(COAXIAL_LAG, own, ExactEstimator(), Guidance(), default_controller=default)
        start = Estimate(still(PLACE_M).motion, HOVER, np.zeros(4))
        self.plant = Plant(COAXIAL_LAG, start, acting=HOVER)
        self.answers = Inbox(channels.EXTERNAL_INPUT, depth=8)
        self.tasks: list[ControlTask] = []
        self.external = ExternalControl(self.pilot, self.answers, self.tasks.append)
        self.frame = 0
        self.see()
        self.pilot.note_applied("armed", -1, HOVER)
        self.pilot.estimator.take_over(start)

    def see(self) -> None:
        self.pilot.observe(StampedMeasurement(1, self.frame, PERIOD_S, measured(self.plant.state)))
        self.frame += 1

    def fly(self, seconds: float, answer: Array | None = None) -> None:
        """Fly on; the program answers every task with one input, or not at all."""
        for _ in range(round(seconds / PERIOD_S)):
            self.external.before_control()
            command = self.pilot.control({}).input
            self.plant.send(command)
            self.external.after_control()
            if answer is not None and self.external.client:
                number, inputs = self.tasks[-1].number, FloatArray.of(np.tile(answer, (20, 1)))
                message = ExternalInput(source="student", number=number, inputs=inputs)
                self.answers.store(encode(message), 0.0)
            self.plant.advance(PERIOD_S)
            self.see()
            self.pilot.note_applied("armed", self.pilot.sequence, command)


@pytest.fixture
def flight() -> Flight:
    flight = Flight()
    flight.fly(0.2)
    assert flight.external.take(TakeControl(source="student")) is None
    return flight


def test_program_that_answers_flies_and_one_that_is_silent_does_not(flight: Flight) -> None:
    flight.fly(0.5, HOVER)
    assert flight.external.client == "student"
    flight.fly(0.3)
    assert flight.external.client == ""
    assert flight.pilot.events["external_silent"] == 1
    assert flight.pilot.controller is flight.own


def test_program_that_dives_loses_control_before_the_floor(flight: Flight) -> None:
    dive = HOVER.copy()
    dive[U_THRUST] = 0.0
    flight.fly(3.0, dive)
    assert flight.external.client == ""
    assert flight.pilot.events["external_unsafe"] == 1
    assert flight.pilot.controller is flight.own
    assert flight.pilot.step_guard.calls.failures["controller_unsafe"] >= 5
    assert flight.plant.state.motion[2] > 0.3
