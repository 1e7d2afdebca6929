"""When a host starts the agent of a vehicle that no agent commands."""

import pytest

from rcopterx.bus.messages import Applied, ArbiterState
from rcopterx.bus.subscription import Received
from rcopterx.deploy.hosts.guarding import (
    AGAIN_S,
    FLOOR_SILENT_S,
    FLOOR_TURN_S,
    FRESH_S,
    SILENT_S,
    TURN_S,
    Guard,
    OnFloor,
    Runners,
)

PERIOD_S = 0.02


def frame(state: ArbiterState, lease: int, sequence: int, arrived_s: float) -> Received[Applied]:
    applied = Applied(
        state=state,
        input=(0.0, 0.0, 0.5, 0.0),
        pulse_width_us=(1500.0,),
        epoch=1,
        frame=1,
        sequence=sequence,
        fresh=True,
        lease=lease,
    )
    return Received(applied, arrived_s)


class Flight:
    """A host that receives a vehicle's serial frames, 50 per second."""

    def __init__(self, turn: int = 0) -> None:
        self.guard = Guard("spare", {"h1": turn})
        self.now_s = 100.0
        self.sequence = 0
        self.started_s: list[float] = []

    def run(
        self, seconds: float, state: ArbiterState = "armed", *, commanded: bool = True, received: bool = True
    ) -> None:
        arrived_s = self.now_s
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            self.sequence += commanded
            arrived_s = self.now_s if received else arrived_s
            sequence = self.sequence if state == "armed" else 0
            frames = {
                "h1": frame(state, 3, sequence, arrived_s),
                "h2": frame("land", 1, 0, arrived_s),
            }
            self.started_s += [self.now_s] * self.guard.find_orphans(self.now_s, frames).count("h1")


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_a_vehicle_that_no_agent_commands_gets_an_agent_in_turn(turn: int) -> None:
    flight = Flight(turn)
    flight.run(1.0)
    silent_s = flight.now_s
    flight.run(0.12, commanded=False)
    flight.run(0.08, "hold", commanded=False)
    flight.run(1.0, "land", commanded=False)
    (started_s,) = flight.started_s
    assert started_s - silent_s == pytest.approx(SILENT_S + turn * TURN_S, abs=0.03)


@pytest.mark.parametrize("state", ["disarmed", "cut", "killed"])
def test_frames_of_vehicles_on_the_floor_say_nothing_about_their_agents(state: str) -> None:
    flight = Flight()
    flight.run(1.0)
    flight.run(3.0, state, commanded=False)
    assert flight.started_s == []


def test_commands_in_time_keep_the_agent_where_it_is() -> None:
    flight = Flight()
    for _ in range(5):
        flight.run(0.1)
        flight.run(SILENT_S - 0.04, "hold", commanded=False)
    assert flight.started_s == []


def test_without_frames_nothing_is_known() -> None:
    flight = Flight()
    flight.run(1.0)
    flight.run(FRESH_S + 2.0, received=False)
    assert flight.started_s == []
    flight.run(SILENT_S - 0.04, "land", commanded=False)
    assert flight.started_s == []


def test_a_vehicle_that_lands_in_spite_of_its_agent_is_left_to_it_for_a_while() -> None:
    flight = Flight()
    flight.run(1.0)
    flight.run(SILENT_S + AGAIN_S, "land", commanded=False)
    assert len(flight.started_s) == 1
    flight.run(SILENT_S, "land", commanded=False)
    assert len(flight.started_s) == 2


@pytest.mark.parametrize("turn", [0, 1])
def test_on_the_floor_the_agents_of_a_silent_host_are_started_in_turn(turn: int) -> None:
    guard = Guard("spare", {"h1": turn})
    known = {"h1": OnFloor(commanded_s=9.0, runner="home", reported_s=10.0)}
    due_s = 10.0 + FLOOR_SILENT_S + turn * FLOOR_TURN_S
    assert guard.find_orphans_on_floor(due_s - 0.1, known) == []
    assert guard.find_orphans_on_floor(due_s + 0.1, known) == ["h1"]


@pytest.mark.parametrize(
    "known",
    [
        OnFloor(commanded_s=99.9, runner="home", reported_s=10.0),
        OnFloor(commanded_s=10.0, runner="home", reported_s=99.0),
        OnFloor(commanded_s=10.0, runner="spare", reported_s=10.0),
    ],
    ids=["it is commanded", "its launcher lives", "it is this host's already"],
)
def test_on_the_floor_no_other_agent_is_replaced(known: OnFloor) -> None:
    guard = Guard("spare", {"h1": 0})
    assert guard.find_orphans_on_floor(100.0, {"h1": known, "h9": OnFloor(1.0, "home", 1.0)}) == []


def test_a_silent_launcher_keeps_its_vehicles_until_another_one_has_had_them() -> None:
    runners = Runners()
    runners.update("home", ["h1", "h2"], 1.0)
    assert runners.of("h1") == ("home", 1.0)
    runners.update("spare", ["h1"], 5.0)
    runners.update("home", ["h1", "h2"], 1.0)
    assert runners.of("h1") == ("spare", 5.0)
    assert runners.of("h2") == ("home", 1.0)
    runners.update("spare", [], 6.0)
    assert runners.of("h1") is None
    runners.update("home", [], 7.0)
    assert runners.of("h2") is None
