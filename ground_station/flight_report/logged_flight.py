"""Reads what a report needs from a flight log."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import RejectedError, decode
from rcopterx.bus.messages import AgentStatus
from rcopterx.bus.requests import VERBS
from rcopterx.deploy.fleet_file.schema import FleetFile
from rcopterx.flight_log.flight_writing import METADATA
from rcopterx.flight_log.mcap_reading import Contents, FlightLogError, messages_of
from rcopterx.flight_log.mcap_writing import LoggedMessage
from rcopterx.ground_station.page.timeline import Event, changes
from rcopterx.ground_station.recorder import Record, Recording
from rcopterx.ground_station.replay.republishing import fleet_of
from rcopterx.ground_station.report import FlightFigures
from rcopterx.ground_station.state import VehicleState

NANO: Final = 1e9
NEEDED: Final[tuple[Channel[Any], ...]] = (
    channels.POSE, channels.PLAN, channels.APPLIED, channels.AGENT_STATUS, channels.TRANSMITTER_STATUS,
    channels.LABORATORY, channels.ROUTER_STATUS, channels.ANSWERED, channels.LAUNCHER_EVENT,
    channels.KILL,
)  # fmt: skip
QUIET_VERBS: Final = frozenset({"recall", "recall_transmitter", "prepare_leaders"})
"""Asked by processes when they start, not by people."""
KILL_PAUSE_S: Final = 1.0
"""Kills are repeated while they are active; one after such a pause is another one."""


@dataclass(frozen=True)
class LoggedFlight:
    """A flight as reports see it.

    Attributes
    ----------
    name
        Of the flight.
    fleet
        The fleet file as it was loaded.
    metadata
        Versions, commit, computer, start; see `rcopterx.flight_log.provenance`.
    figures
        Errors, latencies, fallbacks.
    events
        What happened, in order; times count from `started_s`.
    started_s
        Arrival of the first pose or state of the laboratory on the clock of the recording [s].
    """

    name: str
    fleet: FleetFile
    metadata: dict[str, str]
    figures: FlightFigures
    events: tuple[Event, ...]
    started_s: float


def logged_flight(name: str, parts: Sequence[Path]) -> LoggedFlight:
    """Read a flight from its files.

    Raises
    ------
    FlightLogError
        They cannot be read, or nothing was flown in them.
    """
    contents, topics = Contents(), {channel.topic for channel in NEEDED}
    records = [
        _record(message)
        for path in parts
        for message in messages_of(path, contents)
        if message.topic.rpartition("/")[2] in topics
    ]
    seen = (channels.POSE.topic, channels.LABORATORY.topic)
    started_s = next((record.arrived_s for record in records if record.topic in seen), None)
    if started_s is None:
        raise FlightLogError(f"{name}: the motion capture saw nothing in this flight")
    fleet, recording = fleet_of(parts), Recording(records)
    return LoggedFlight(
        name,
        fleet,
        contents.metadata.get(METADATA, {}),
        FlightFigures(recording, list(fleet.vehicles)),
        tuple(events_of(recording, list(fleet.vehicles), started_s)),
        started_s,
    )


def _record(message: LoggedMessage) -> Record:
    unit, _, topic = message.topic.partition("/")
    return Record(unit, topic, message.payload, message.time_ns / NANO)


def events_of(recording: Recording, vehicles: Iterable[str], started_s: float) -> list[Event]:
    """What happened in a recorded flight, in order.

    Parameters
    ----------
    recording
        The flight.
    vehicles
        Names.
    started_s
        Time of the recording from which events count theirs [s].
    """
    found = [event for name in vehicles for event in _vehicle_events(recording, name)]
    for name in recording.units(channels.ANSWERED):
        found += _requests(recording, name)
    for host in recording.units(channels.LAUNCHER_EVENT):
        told = recording.messages(channels.LAUNCHER_EVENT, host)
        found += [Event(arrived_s, host, event.text) for event, arrived_s in told]
    found += _kills(recording)
    return sorted(
        (Event(event.time_s - started_s, event.vehicle, event.text, event.alarming) for event in found),
        key=attrgetter("time_s"),
    )


def _vehicle_events(recording: Recording, name: str) -> Iterator[Event]:
    """Changes of what the agent and the transmitter gateway say of a vehicle."""
    statuses: tuple[Channel[Any], ...] = (channels.AGENT_STATUS, channels.TRANSMITTER_STATUS)
    told = [
        (arrived_s, message)
        for channel in statuses
        for message, arrived_s in recording.messages(channel, name)
    ]
    before = VehicleState(name, None, None, None, None, None)
    for arrived_s, message in sorted(told, key=lambda item: item[0]):
        agent, transmitter = before.agent, before.transmitter
        if isinstance(message, AgentStatus):
            agent = message
        else:
            transmitter = message
        after = VehicleState(name, agent, transmitter, 0.0, 0.0, None)
        if before.agent is not None and before.transmitter is not None:
            yield from changes(arrived_s, before, after)
        before = after


def _requests(recording: Recording, name: str) -> Iterator[Event]:
    for answered, arrived_s in recording.messages(channels.ANSWERED, name):
        verb = VERBS.get(answered.verb)
        if verb is None or answered.verb in QUIET_VERBS:
            continue
        try:
            reply = decode(answered.reply, verb.reply)
        except RejectedError:
            continue
        text = answered.verb if reply.accepted else f"{answered.verb} refused: {reply.reason}"
        yield Event(arrived_s, name, text, not reply.accepted)


def _kills(recording: Recording) -> Iterator[Event]:
    last_s = float("-inf")
    for unit in recording.units(channels.KILL):
        for kill, arrived_s in recording.messages(channels.KILL, unit):
            if arrived_s - last_s > KILL_PAUSE_S:
                whom = ", ".join(kill.vehicles) or "everybody"
                yield Event(arrived_s, kill.source, f"KILL {whom}: {kill.reason}", True)
            last_s = arrived_s
