"""One agent in a flight log: its steps with their inputs, its commands and its plans."""

import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from rcopterx.agents.guards.time_limit import Overtime
from rcopterx.bus import channels
from rcopterx.bus.codec import RejectedError, decode, encode
from rcopterx.bus.log_messages import AgentSteps, AnsweredRequest, RoundedEstimate
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Command, Lease, Plan
from rcopterx.bus.stepping import REQUEST
from rcopterx.fleet.schema import FleetFile
from rcopterx.flights.flight_writing import METADATA
from rcopterx.flights.mcap_reading import LogContents, messages_of
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.ground_station.republishing import fleet_of

Frame = tuple[int, int]  # epoch and frame of the motion capture


@dataclass(frozen=True, slots=True)
class StepInput:
    """An input of a step; `payload` is None where the flight log does not have it."""

    key: str
    subscription: int
    payload: bytes | None
    arrived_s: float


@dataclass(frozen=True, slots=True)
class AgentStep:
    """One step of an agent."""

    time_s: float
    inputs: tuple[StepInput, ...]
    estimate: RoundedEstimate | None = None  # None unless the step controlled the vehicle
    overtime: tuple[Overtime, ...] = ()  # computations that ran out of time


@dataclass
class AgentLife:
    """One process of an agent, from its start to its end; see `rcopterx.bus.log_messages.AgentSteps`."""

    life: int
    began_s: float
    from_start: bool  # whether the flight log has its first step
    replies: tuple[bytes, ...]  # replies to its requests during start-up
    steps: list[AgentStep] = field(default_factory=list)
    lost_steps: int = 0  # number of missing messages about steps
    granted: bytes | None = None  # the reply that granted its lease, if before the log's first step


@dataclass(frozen=True)
class RecordedAgent:
    """An agent of a flight log."""

    vehicle: str
    fleet: FleetFile
    metadata: dict[str, str]
    lives: tuple[AgentLife, ...]
    commands: dict[tuple[int, int], bytes]
    """Encoded commands by lease and sequence."""
    plans: dict[Frame, list[bytes]]
    """Encoded plans by their frame, in order."""


def recorded_agent(parts: Sequence[Path], vehicle: str) -> RecordedAgent:
    """Read the agent of a vehicle from the files of a flight, in order; raises FlightLogError."""
    contents = LogContents()
    own = _own_messages(parts, vehicle, contents)
    fleet = fleet_of(parts)
    if vehicle not in fleet.vehicles:
        raise FlightLogError(f"{vehicle}: no such vehicle, the flight has {', '.join(fleet.vehicles)}")
    if not own.steps:
        raise FlightLogError(f"{vehicle}: the flight log has no steps of its agent")
    lives = _lives(own, _payloads(parts, own))
    metadata = contents.metadata.get(METADATA, {})
    return RecordedAgent(vehicle, fleet, metadata, lives, own.commands, own.plans)


@dataclass
class _OwnMessages:
    lease_topic: str
    steps: list[AgentSteps] = field(default_factory=list)
    requests: dict[tuple[str, int], bytes] = field(default_factory=dict)
    commands: dict[tuple[int, int], bytes] = field(default_factory=dict)
    plans: dict[Frame, list[bytes]] = field(default_factory=dict)

    def add(self, message: Message, payload: bytes) -> None:
        match message:
            case AgentSteps():
                self.steps.append(message)
            case AnsweredRequest():
                self.requests[f"{REQUEST}/{message.verb}", zlib.crc32(message.request)] = message.request
            case Command():
                self.commands[message.lease, message.sequence] = payload
            case Plan():
                self.plans.setdefault((message.epoch, message.frame), []).append(payload)


def _own_messages(parts: Sequence[Path], vehicle: str, contents: LogContents) -> _OwnMessages:
    own = _OwnMessages(f"{vehicle}/{channels.LEASE.topic}")
    needed = (channels.AGENT_STEPS, channels.ANSWERED, channels.COMMAND, channels.PLAN)
    kinds = {f"{vehicle}/{channel.topic}": channel.message for channel in needed}
    for path in parts:
        for topic, payload, *_ in messages_of(path, contents):
            if topic in kinds:
                try:
                    own.add(decode(payload, kinds[topic]), payload)
                except RejectedError as error:
                    raise FlightLogError(f"{topic}: of another version: {error}") from None
    return own


def _payloads(parts: Iterable[Path], own: _OwnMessages) -> dict[tuple[str, int], bytes]:
    """Inputs of the steps, by key and checksum."""
    wanted = {pair for steps in own.steps for pair in zip(steps.keys, steps.checksums, strict=True)}
    keys = {key for key, _ in wanted}
    found = dict(own.requests)
    leases = ((own.lease_topic, payload) for payload in _possible_leases(own))
    recorded = (message[:2] for path in parts for message in messages_of(path) if message.topic in keys)
    for key, payload in chain(leases, recorded):
        pair = (key, zlib.crc32(payload))
        if pair in wanted:
            found[pair] = payload
    return found


def _possible_leases(own: _OwnMessages) -> Iterator[bytes]:
    """Every reply that may have granted this life of the agent the lease under which it commanded."""
    numbers = {number for number, _ in own.commands}
    for life in {steps.life for steps in own.steps}:
        for number in numbers:
            for commanding in {0, number - 1, number}:
                yield encode(Lease(agent=life, number=number, commanding=commanding, issued=number))


def _granted(own: _OwnMessages, life: int, payloads: dict[tuple[str, int], bytes]) -> bytes | None:
    """The reply that granted a life its lease, if only one is possible."""
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


def _lives(own: _OwnMessages, payloads: dict[tuple[str, int], bytes]) -> tuple[AgentLife, ...]:
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
                granted=_granted(own, steps.life, payloads) if steps.number > 0 else None,
            )
        life.lost_steps += steps.number - numbers.get(steps.life, steps.number - 1) - 1
        numbers[steps.life] = steps.number
        life.steps += _steps_of(steps, payloads)
    return tuple(lives.values())


def _steps_of(steps: AgentSteps, payloads: dict[tuple[str, int], bytes]) -> list[AgentStep]:
    columns = zip(steps.keys, steps.subscriptions, steps.checksums, steps.arrivals_s, strict=True)
    inputs = [
        # A notification of the agent itself has no payload.
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
