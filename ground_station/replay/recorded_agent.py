"""What a flight log knows of one agent: its steps with what they took in, its commands and its plans."""

import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rcopterx.agents.guards.time_limit import Overtime
from rcopterx.bus import channels
from rcopterx.bus.codec import RejectedError, decode, encode
from rcopterx.bus.log_messages import AgentSteps, AnsweredRequest, RoundedEstimate
from rcopterx.bus.messages import Command, Lease, Plan
from rcopterx.bus.stepping import REQUEST
from rcopterx.fleet.schema import FleetFile
from rcopterx.flights.flight_writing import METADATA
from rcopterx.flights.mcap_reading import Contents, FlightLogError, messages_of
from rcopterx.ground_station.replay.republishing import fleet_of

Frame = tuple[int, int]
"""Epoch and frame of the motion capture."""


@dataclass(frozen=True, slots=True)
class StepInput:
    """Something a step took in; `payload` is None where the flight log does not have it."""

    key: str
    subscription: int
    payload: bytes | None
    arrived_s: float


@dataclass(frozen=True, slots=True)
class AgentStep:
    """One step; `estimate` is None unless it controlled, `overtime` what it gave up for time."""

    time_s: float
    inputs: tuple[StepInput, ...]
    estimate: RoundedEstimate | None = None
    overtime: tuple[Overtime, ...] = ()


@dataclass
class AgentLife:
    """One process of an agent, from its start to its end.

    Attributes
    ----------
    life, began_s
        See `rcopterx.bus.log_messages.AgentSteps`.
    from_start
        Whether the flight log has its first step.
    replies
        To what the agent asked when it was made.
    commands
        Of all lives, encoded, by lease and sequence.
    plans
        Of all lives, encoded, by the frame they were made for, in order.
    lost_steps
        Messages about steps that are missing.
    granted
        The answer, encoded, that gave it its lease, if that was before the first step of the flight log.
    """

    life: int
    began_s: float
    from_start: bool
    replies: tuple[bytes, ...]
    steps: list[AgentStep] = field(default_factory=list)
    commands: dict[tuple[int, int], bytes] = field(default_factory=dict)
    plans: dict[Frame, list[bytes]] = field(default_factory=dict)
    lost_steps: int = 0
    granted: bytes | None = None


@dataclass(frozen=True)
class RecordedAgent:
    """An agent of a flight log."""

    vehicle: str
    fleet: FleetFile
    metadata: dict[str, str]
    lives: tuple[AgentLife, ...]


def recorded_agent(parts: Sequence[Path], vehicle: str) -> RecordedAgent:
    """Collect what a flight log knows of the agent of a vehicle.

    Parameters
    ----------
    parts
        Files of the flight in order.
    vehicle
        Name of the vehicle.

    Raises
    ------
    FlightLogError
        They cannot be read, or know nothing of the vehicle.
    """
    contents = Contents()
    own = _Own(vehicle)
    for path in parts:
        for message in messages_of(path, contents):
            own.take(message.topic, message.payload)
    fleet = fleet_of(parts)
    if vehicle not in fleet.vehicles:
        raise FlightLogError(f"{vehicle}: no such vehicle, the flight has {', '.join(fleet.vehicles)}")
    if not own.steps:
        raise FlightLogError(f"{vehicle}: the flight log has no steps of its agent")
    payloads = _payloads(parts, own)
    lives = _lives(own, payloads)
    return RecordedAgent(vehicle, fleet, contents.metadata.get(METADATA, {}), lives)


class _Own:
    """What an agent said itself, and what it was asked."""

    def __init__(self, vehicle: str) -> None:
        self.lease_topic = f"{vehicle}/{channels.LEASE.topic}"
        self._topics = {
            f"{vehicle}/{channel.topic}": take
            for channel, take in (
                (channels.AGENT_STEPS, self._steps),
                (channels.ANSWERED, self._answered),
                (channels.COMMAND, self._command),
                (channels.PLAN, self._plan),
            )
        }
        self.steps: list[AgentSteps] = []
        self.requests: dict[tuple[str, int], bytes] = {}
        self.commands: dict[tuple[int, int], bytes] = {}
        self.plans: dict[Frame, list[bytes]] = {}

    def take(self, topic: str, payload: bytes) -> None:
        take = self._topics.get(topic)
        if take is not None:
            try:
                take(payload)
            except RejectedError as error:
                raise FlightLogError(f"{topic}: of another version: {error}") from None

    def _steps(self, payload: bytes) -> None:
        self.steps.append(decode(payload, AgentSteps))

    def _answered(self, payload: bytes) -> None:
        answered = decode(payload, AnsweredRequest)
        self.requests[f"{REQUEST}/{answered.verb}", zlib.crc32(answered.request)] = answered.request

    def _command(self, payload: bytes) -> None:
        command = decode(payload, Command)
        self.commands[command.lease, command.sequence] = payload

    def _plan(self, payload: bytes) -> None:
        plan = decode(payload, Plan)
        self.plans.setdefault((plan.epoch, plan.frame), []).append(payload)


def _payloads(parts: Iterable[Path], own: _Own) -> dict[tuple[str, int], bytes]:
    """Everything the steps took in, by key and checksum."""
    wanted = {pair for steps in own.steps for pair in zip(steps.keys, steps.checksums, strict=True)}
    keys = {key for key, _ in wanted}
    found = dict(own.requests)
    for payload in _answers(own):
        pair = (own.lease_topic, zlib.crc32(payload))
        if pair in wanted:
            found[pair] = payload
    for path in parts:
        for message in messages_of(path):
            if message.topic in keys:
                pair = (message.topic, zlib.crc32(message.payload))
                if pair in wanted:
                    found[pair] = message.payload
    return found


def _answers(own: _Own) -> Iterator[bytes]:
    """Every answer that may have given a life of the agent a lease that has commanded.

    A fleet starts all processes at once, so leases may be given before the recorder listens. Nobody
    commands without one, and a replay would do nothing. The checksum of what the agent took in tells
    which answer it was.
    """
    numbers = {number for number, _ in own.commands}
    for life in {steps.life for steps in own.steps}:
        for number in numbers:
            for commanding in {0, number - 1, number}:
                yield encode(Lease(agent=life, number=number, commanding=commanding, issued=number))


def _granted(own: _Own, life: int, payloads: dict[tuple[str, int], bytes]) -> bytes | None:
    """The answer that gave a life its lease, if it can only be one."""
    given = {
        lease.number: lease.agent
        for (key, _), payload in payloads.items()
        if key == own.lease_topic and (lease := decode(payload, Lease)).number
    }
    numbers = [number for number in {number for number, _ in own.commands} if given.get(number, life) == life]
    if len(numbers) != 1:
        return None
    (number,) = numbers
    return encode(Lease(agent=life, number=number, commanding=number, issued=number))


def _lives(own: _Own, payloads: dict[tuple[str, int], bytes]) -> tuple[AgentLife, ...]:
    lives: dict[int, AgentLife] = {}
    numbers: dict[int, int] = {}
    for steps in own.steps:
        life = lives.get(steps.life)
        if life is None:
            life = lives[steps.life] = AgentLife(
                steps.life,
                steps.began_s,
                steps.number == 0,
                steps.replies,
                commands=own.commands,
                plans=own.plans,
                granted=_granted(own, steps.life, payloads) if steps.number > 0 else None,
            )
        life.lost_steps += steps.number - numbers.get(steps.life, steps.number - 1) - 1
        numbers[steps.life] = steps.number
        life.steps += _steps_of(steps, payloads)
    return tuple(lives.values())


def _steps_of(steps: AgentSteps, payloads: dict[tuple[str, int], bytes]) -> list[AgentStep]:
    columns = zip(steps.keys, steps.subscriptions, steps.checksums, steps.arrivals_s, strict=True)
    inputs = [
        # A word of the agent's own has no bytes.
        StepInput(key, number, payloads.get((key, checksum), None if "/" in key else b""), arrived_s)
        for key, number, checksum, arrived_s in columns
    ]
    found, start = [], 0
    last = len(steps.times_s) - 1
    for number, (time_s, count) in enumerate(zip(steps.times_s, steps.counts, strict=True)):
        overtime = tuple((call, question) for step, call, question in steps.overtime if step == number)
        estimate = steps.estimate if number == last else None
        found.append(AgentStep(time_s, tuple(inputs[start : start + count]), estimate, overtime))
        start += count
    return found
