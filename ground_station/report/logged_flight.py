"""Reads what a report needs from a flight log."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path
from typing import Any, Final

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.fleet.schema import FleetFile
from rcopterx.flights.flight_writing import METADATA
from rcopterx.flights.mcap_reading import Contents, FlightLogError, messages_of
from rcopterx.flights.mcap_writing import LoggedMessage
from rcopterx.ground_station.event_feed import HEARD, EventFeed
from rcopterx.ground_station.page.timeline import Event
from rcopterx.ground_station.replay.republishing import fleet_of
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import Record, Recording

NANO: Final = 1e9
NEEDED: Final[tuple[Channel[Any], ...]] = (
    channels.POSE, channels.PLAN, channels.APPLIED, channels.LABORATORY, channels.ROUTER_STATUS, *HEARD,
)  # fmt: skip


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
        Versions, commit, computer, start; see `rcopterx.flights.provenance`.
    figures
        Errors, latencies, fallbacks.
    events
        What happened, in order; times count from `started_s`.
    started_s
        Arrival of the first pose or state of the laboratory on the clock of the recording [s].
    rejected
        Messages that this version does not understand, by topic and reason: the report lacks them.
    """

    name: str
    fleet: FleetFile
    metadata: dict[str, str]
    figures: FlightFigures
    events: tuple[Event, ...]
    started_s: float
    rejected: dict[str, int]


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
    figures = FlightFigures(recording, list(fleet.vehicles))
    events = tuple(events_of(recording, started_s))
    metadata = contents.metadata.get(METADATA, {})
    return LoggedFlight(name, fleet, metadata, figures, events, started_s, dict(recording.rejected))


def _record(message: LoggedMessage) -> Record:
    unit, _, topic = message.topic.partition("/")
    return Record(unit, topic, message.payload, message.time_ns / NANO)


def events_of(recording: Recording, started_s: float) -> list[Event]:
    """What happened in a recorded flight, in order.

    Parameters
    ----------
    recording
        The flight.
    started_s
        Time of the recording from which events count theirs [s].
    """
    feed = EventFeed()
    messages = [
        (arrived_s, unit, message)
        for channel in HEARD
        for unit in recording.units(channel)
        for message, arrived_s in recording.messages(channel, unit)
    ]
    return [
        event
        for arrived_s, unit, message in sorted(messages, key=itemgetter(0))
        for event in feed.take(unit, message, arrived_s - started_s)
    ]
