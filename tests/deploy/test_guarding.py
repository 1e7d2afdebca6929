"""When a host starts the agent of a vehicle that nobody commands in flight."""

import pytest

from rcopterx.deploy.guarding import AGAIN_S, HEARD_S, SILENT_S, TURN_S, Guard, LastFrame

PERIOD_S = 0.02


class Flight:
    """A host that hears of a vehicle's serial frames, 50 a second."""

    def __init__(self, turn: int = 0) -> None:
        self.guard = Guard({"h1": turn})
        self.now_s = 100.0
        self.sequence = 0
        self.started_s: list[float] = []

    def run(
        self, seconds: float, state: str = "armed", *, commanded: bool = True, heard: bool = True
    ) -> None:
        heard_s = self.now_s
        for _ in range(round(seconds / PERIOD_S)):
            self.now_s += PERIOD_S
            self.sequence += commanded
            heard_s = self.now_s if heard else heard_s
            sequence = self.sequence if state == "armed" else 0
            frames = {
                "h1": LastFrame(state, (3, sequence), heard_s),
                "h2": LastFrame("land", (1, 0), heard_s),
            }
            self.started_s += [self.now_s] * self.guard.look(self.now_s, frames).count("h1")


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_a_vehicle_that_nobody_commands_gets_an_agent_in_turn(turn: int) -> None:
    flight = Flight(turn)
    flight.run(1.0)
    silent_s = flight.now_s
    flight.run(0.12, commanded=False)
    flight.run(0.08, "hold", commanded=False)
    flight.run(1.0, "land", commanded=False)
    (started_s,) = flight.started_s
    assert started_s - silent_s == pytest.approx(SILENT_S + turn * TURN_S, abs=0.03)


@pytest.mark.parametrize("state", ["disarmed", "cut", "killed"])
def test_on_the_floor_nobody_is_missed(state: str) -> None:
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
    flight.run(HEARD_S + 2.0, heard=False)
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
