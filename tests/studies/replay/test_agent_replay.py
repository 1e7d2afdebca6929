"""Promises of replays: an agent repeats the flight, and the first difference is reported with its cause."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rcopterx.agents.guards.time_limit import TimeLimit
from rcopterx.agents.process import TRAJECTORY_CHECKED, TUNED, Agent
from rcopterx.bus.codec import decode, encode
from rcopterx.bus.log_messages import AgentSteps
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Command, Plan, Pose
from rcopterx.deploy.roles.agent import pilot_of
from rcopterx.flights.mcap_reading import messages_of
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.flights.mcap_writing import LoggedMessage
from rcopterx_studies.replay import recorded_agent as recorded_agent_module
from rcopterx_studies.replay.agent_replay import TOLERANCE, changed, control_periods
from rcopterx_studies.replay.agent_replay import replay as replayed
from rcopterx_studies.replay.recorded_agent import AgentStep, RecordedAgent, StepInput, recorded_agent
from rcopterx_studies.replay.replay_bus import ReplayBus

FLIGHT = Path(__file__).parents[2] / "fixtures" / "reference_flight.mcap"
"""Two vehicles that take off, move, change an offset, a horizon and a controller."""


@pytest.fixture(scope="module")
def follower() -> RecordedAgent:
    return recorded_agent([FLIGHT], "h2")


def with_steps(recorded: RecordedAgent, steps: list[AgentStep]) -> RecordedAgent:
    (life,) = recorded.lives
    return replace(recorded, lives=(replace(life, steps=steps),))


def with_step(recorded: RecordedAgent, number: int, step: AgentStep) -> RecordedAgent:
    (life,) = recorded.lives
    return with_steps(recorded, [*life.steps[:number], step, *life.steps[number + 1 :]])


def flown_pose(recorded: RecordedAgent) -> tuple[int, int]:
    """Step and number of an input that is a pose, in the second half of the flight."""
    (life,) = recorded.lives
    for number in range(len(life.steps) * 3 // 4, len(life.steps)):
        for position, item in enumerate(life.steps[number].inputs):
            if item.key == "h2/pose":
                return number, position
    raise AssertionError("no pose")


def with_input(recorded: RecordedAgent, number: int, position: int, item: StepInput) -> RecordedAgent:
    step = recorded.lives[0].steps[number]
    inputs = (*step.inputs[:position], item, *step.inputs[position + 1 :])
    return with_step(recorded, number, replace(step, inputs=inputs))


@pytest.mark.parametrize("vehicle", ["h1", "h2"])
def test_the_reference_flight_is_flown_the_same_again(vehicle: str) -> None:
    recorded = recorded_agent([FLIGHT], vehicle)
    result = replayed(recorded, recorded.fleet, TOLERANCE)
    assert result.first is None, (result.first, "renew it: python tests/fixtures/renew_reference_flight.py")
    assert result.periods > 100
    assert (result.missing_inputs, result.unmatched, result.notes) == (0, 0, [])
    assert result.largest_input <= TOLERANCE
    assert result.largest_plan <= TOLERANCE


def test_another_pose_is_told_as_another_estimate_in_the_period_it_enters(follower: RecordedAgent) -> None:
    number, position = flown_pose(follower)
    item = follower.lives[0].steps[number].inputs[position]
    assert item.payload is not None
    pose = decode(item.payload, Pose)
    assert pose.position_m is not None
    x, y, z = pose.position_m
    moved = encode(
        Pose(**{**{f: getattr(pose, f) for f in Pose.__struct_fields__}, "position_m": (x + 0.01, y, z)})
    )
    result = replayed(
        with_input(follower, number, position, replace(item, payload=moved)), follower.fleet, TOLERANCE
    )
    assert result.first is not None
    assert result.first.cause == "estimate"
    began_s = follower.lives[0].steps[0].time_s
    assert 0 <= result.first.time_s + began_s - follower.lives[0].steps[number].time_s < 0.1


@pytest.mark.parametrize("place", [0, 1])
def test_plans_that_another_agent_made_for_the_same_frames_are_not_mistaken_for_its_own(
    follower: RecordedAgent, place: int
) -> None:
    other = next(iter(follower.plans.values()))[0]
    plans = {frame: [*own[:place], other, *own[place:]] for frame, own in follower.plans.items()}
    result = replayed(replace(follower, plans=plans), follower.fleet, TOLERANCE)
    assert result.first is None
    assert result.unmatched == 0


def test_an_input_that_the_log_has_lost_is_told_as_the_cause(follower: RecordedAgent) -> None:
    number, position = flown_pose(follower)
    item = follower.lives[0].steps[number].inputs[position]
    result = replayed(
        with_input(follower, number, position, replace(item, payload=None)), follower.fleet, TOLERANCE
    )
    assert result.first is not None
    assert result.first.cause == "input"
    assert result.missing_inputs == 1


def heard_late(monkeypatch: pytest.MonkeyPatch, lost: Callable[[LoggedMessage], bool]) -> RecordedAgent:
    """What is known of h2 by a recorder that did not listen yet when some messages were sent."""
    monkeypatch.setattr(
        recorded_agent_module,
        "messages_of",
        lambda *arguments: (message for message in messages_of(*arguments) if not lost(message)),
    )
    return recorded_agent([FLIGHT], "h2")


def test_a_lease_given_before_the_recorder_listened_is_known_by_its_checksum(
    follower: RecordedAgent, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded = heard_late(monkeypatch, lambda message: message.topic == "h2/lease")
    result = replayed(recorded, recorded.fleet, TOLERANCE)
    assert result.first is None
    # Another processor may round the last digit of a number otherwise than the one that flew.
    known = replayed(follower, follower.fleet, TOLERANCE)
    assert result.periods == known.periods
    assert result.identical == known.identical > 100


def test_an_agent_whose_first_steps_are_lost_flies_with_the_lease_of_its_commands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def lost(message: LoggedMessage) -> bool:
        if message.topic == "h2/lease":
            return True
        return message.topic == "h2/steps" and decode(message.payload, AgentSteps).number < 2

    recorded = heard_late(monkeypatch, lost)
    result = replayed(recorded, recorded.fleet, TOLERANCE)
    assert result.notes == ["the recording begins after the start of the agent"]
    assert result.periods > 100


def test_another_controller_tells_what_it_would_have_commanded(follower: RecordedAgent) -> None:
    result = replayed(follower, changed(follower.fleet, "h2", {"controller": "pid"}), TOLERANCE)
    assert result.first is not None
    assert result.first.cause == "solution"
    assert result.largest_input > 0.01
    assert max(result.rms_input) > 0.001


class Hasty(TimeLimit):
    """Takes many calls to be too long: from a question of the solver on, or when they have come."""

    def __init__(self, seed: int) -> None:
        self._draw = np.random.default_rng(seed)
        self._asked, self._from, self._after = 0, 0, False

    def begin(self, limit_s: float) -> None:
        # No solver asks during calls of an estimator; some of those are late as well, few enough to go on.
        self._asked = 0
        self._from = int(self._draw.integers(1, 4)) if self._draw.random() < 0.8 else 10**6
        self._after = bool(self._draw.random() < 0.01)

    def end(self, limit_s: float) -> bool:
        return self._after

    def over(self, limit_s: float) -> bool:
        self._asked += 1
        return self._asked >= self._from


class NotingBus(ReplayBus):
    """Keeps what was given up in each step."""

    overtime: tuple[tuple[int, int], ...] = ()

    def end_step(
        self, vehicle: str, estimate: Sequence[float] | None, overtime: Sequence[tuple[int, int]] = ()
    ) -> None:
        super().end_step(vehicle, estimate)
        self.overtime = tuple(overtime)


def flown_hastily(recorded: RecordedAgent) -> tuple[list[AgentStep], list[Message], list[Message]]:
    """Steps with what an agent in a hurry gave up in each, its commands, and its plans."""
    (life,) = recorded.lives
    done: list[Message] = []
    bus = NotingBus(life, lambda _, message: done.append(message))
    settings, pilot = pilot_of(recorded.fleet, recorded.vehicle)
    agent = Agent(settings, pilot, bus, realtime=False, stopwatch=lambda: 0.0, limit=Hasty(1))
    steps: list[AgentStep] = []
    for step in life.steps:
        if any(item.key in (TUNED, TRAJECTORY_CHECKED) for item in step.inputs):
            agent.wait_for_work()
        bus.take(step)
        agent.step()
        steps.append(replace(step, overtime=bus.overtime))
    agent.wait_for_work()
    commands, plans = ([message for message in done if isinstance(message, kind)] for kind in (Command, Plan))
    return steps, commands, plans


def test_steps_given_up_for_time_are_given_up_again(follower: RecordedAgent) -> None:
    # Within small sticks and slow motion the first attempt of a solver fails, so that it asks for time.
    small = {
        "input_min": [-0.02, -0.02, 0.0, -0.02],
        "input_max": [0.02, 0.02, 0.56, 0.02],
        "state_min": [-0.05, -0.05, 0.0, -0.02, -0.02, -0.05, -0.05],
        "state_max": [0.05, 0.05, 1.0, 0.02, 0.02, 0.05, 0.05],
        "max_iterations": 1,
    }
    follower = replace(follower, fleet=changed(follower.fleet, "h2", small))
    steps, commands, plans = flown_hastily(follower)
    questions = [question for step in steps for _, question in step.overtime]
    assert any(question > 0 for question in questions)
    assert questions.count(0) > 2
    (life,) = follower.lives
    periods = [period for _, period in control_periods("h2", follower.fleet, replace(life, steps=steps))]
    assert len(periods) > 100
    assert [period.command for period in periods] == commands
    assert [period.plan for period in periods] == plans
    result = replayed(with_steps(follower, steps), follower.fleet, TOLERANCE)
    assert result.first is not None, "nothing was given up that mattered"
    assert result.first.cause in ("estimate", "solution")


def test_changes_are_those_of_one_vehicle_and_other_controllers_forget_its_settings(
    follower: RecordedAgent,
) -> None:
    fleet = changed(follower.fleet, "h2", {"horizon": 20, "position_weight": 3.0})
    assert (fleet.vehicles["h2"].control.horizon, fleet.vehicles["h2"].control.settings) == (
        20, {"position_weight": 3.0},
    )  # fmt: skip
    assert fleet.vehicles["h1"] == follower.fleet.vehicles["h1"]
    assert changed(fleet, "h2", {"controller": "pid"}).vehicles["h2"].control.settings == {}


def test_a_vehicle_that_did_not_fly_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FlightLogError, match="h9: no such vehicle, the flight has h1, h2"):
        recorded_agent([FLIGHT], "h9")
