"""A take-off whose commands pause while the vehicle stands on the floor: pilot, arbiter and a vehicle."""

import numpy as np
import pytest
from pilot_bench import real
from support.flight import Plant, measured
from support.vehicle_types import COAXIAL_LAG

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.arbiter import Arbiter
from rcopterx.transmitter_gateway.inputs import (
    FLYING,
    NAMES,
    Action,
    ActionRequest,
    CommandInput,
    LinkState,
    PoseInput,
)
from rcopterx.vehicles.phases import Phase

PERIOD_S = 0.02
ARMED_AT_S = 0.6
HEIGHT_M = 0.3


class TakeOff:
    """One vehicle on the floor, its agent and its arbiter, in virtual time."""

    def __init__(self) -> None:
        self.pilot, self.plant = real("cascade", "extended_kalman"), Plant()
        self.arbiter = Arbiter("h1", ArbiterLimits(), COAXIAL_LAG.hover_input[2], (20.0, 20.0, 4.0, 8.0))
        self.arbiter.link(LinkState.READY)
        self.arbiter.bid(1, 0.0, take_over=False)
        self.frame = 0
        self.applied: list[tuple[str, int, np.ndarray]] = []

    @property
    def now_s(self) -> float:
        return self.frame * PERIOD_S

    def run(self, seconds: float, commanding: bool = True) -> None:
        """Fly; without commands the agent gets no processor."""
        for _ in range(round(seconds / PERIOD_S)):
            self.frame += 1
            self.plant.advance(PERIOD_S)
            seen = measured(self.plant.state)
            x, y, z = map(float, seen.position_m)
            self.arbiter.pose(PoseInput("h1", 1, self.frame, (x, y, z), PERIOD_S, seen.yaw_rad), self.now_s)
            if commanding:
                self._command(StampedMeasurement(1, self.frame, PERIOD_S, seen))
            output = self.arbiter.step(self.now_s)
            self.plant.send(np.array(output.u) if output.state in FLYING else np.zeros(4))
            sequence = 0 if output.cause is None else output.cause.sequence
            self.applied.append((NAMES[output.state], sequence, np.array(output.u)))

    def _command(self, seen: StampedMeasurement) -> None:
        for state, sequence, value in self.applied:
            self.pilot.note_applied(state, sequence, value)
        self.applied.clear()
        self.pilot.observe(seen)
        control = self.pilot.control({})
        command = CommandInput(1, 1, self.pilot.sequence, self.frame, control.input, control.next_inputs)
        assert self.arbiter.command(command, self.now_s).accepted


@pytest.mark.parametrize(("begins_s", "pause_s"), [(0.1, 0.04), (0.2, 0.3), (0.3, 0.2)])
def test_vehicle_takes_off_although_its_commands_pause_on_the_floor(begins_s: float, pause_s: float) -> None:
    flight = TakeOff()
    flight.run(ARMED_AT_S)
    assert flight.arbiter.request(ActionRequest(Action.ARM, "operator"), flight.now_s).accepted
    flight.run(0.1)
    assert flight.pilot.take_off(HEIGHT_M) is None
    flight.run(begins_s)
    flight.run(pause_s, commanding=False)
    assert flight.plant.on_floor
    flight.run(3.0 - begins_s)
    assert flight.pilot.guidance.phase is Phase.FLYING
    assert flight.plant.state.motion[2] == pytest.approx(HEIGHT_M, abs=0.1)
