"""Reads the data of a report from a flight log."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.clock import NANO
from rcopterx.bus.session import RawMessage
from rcopterx.fleet.schema import FleetFile
from rcopterx.flights.flight_writing import METADATA
from rcopterx.flights.mcap_reading import LogContents, messages_of
from rcopterx.flights.mcap_records import FlightLogError
from rcopterx.ground_station.events import EVENT_CHANNELS, EventFeed, LoggedEvent
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.ground_station.republishing import fleet_of

NEEDED: Final[tuple[Channel[Any], ...]] = (
    channels.POSE, channels.PLAN, channels.APPLIED, channels.LABORATORY, channels.ROUTER_STATUS,
    channels.LAUNCHER, channels.RECORDER, channels.TRACKER_STATUS, *EVENT_CHANNELS,
)  # fmt: skip


@dataclass(frozen=True)
class LoggedFlight:
    """Data of a recorded flight for reports."""

    name: str
    fleet: FleetFile
    metadata: dict[str, str]  # versions, commit, computer, start; see `rcopterx.flights.provenance`
    recording: Recording
    figures: FlightFigures
    events: tuple[LoggedEvent, ...]  # in order; times count from `started_s`
    started_s: float  # arrival of the first pose or state of the laboratory on the clock of the recording
    rejected: dict[str, int]  # messages that this version does not understand, by topic and reason
    missing: tuple[str, ...]  # sentences about what the log lacks


def logged_flight(name: str, parts: Sequence[Path], missing: Sequence[str] = ()) -> LoggedFlight:
    """Read a flight from its files, of which something may be `missing`; raises FlightLogError."""
    contents = LogContents()
    recording, fleet = Recording(records_of(parts, NEEDED, contents)), fleet_of(parts)
    return flight_of(name, fleet, recording, contents.metadata.get(METADATA, {}), missing)


def flight_of(
    name: str, fleet: FleetFile, recording: Recording, metadata: dict[str, str], missing: Sequence[str] = ()
) -> LoggedFlight:
    """Return a flight from its messages; raises FlightLogError if the motion capture saw nothing in it."""
    seen = (channels.POSE.topic, channels.LABORATORY.topic)
    started_s = next((record.arrived_s for record in recording.records() if record.topic in seen), None)
    if started_s is None:
        raise FlightLogError(f"{name}: the motion capture saw nothing in this flight")
    figures = FlightFigures(recording, list(fleet.vehicles))
    events = tuple(events_of(recording, started_s))
    rejected = dict(recording.rejected)
    return LoggedFlight(
        name, fleet, metadata, recording, figures, events, started_s, rejected, tuple(missing)
    )


def records_of(
    parts: Sequence[Path], needed: Iterable[Channel[Any]], contents: LogContents | None = None
) -> Iterator[RawMessage]:
    """Messages of some channels from the files of a flight; raises FlightLogError."""
    topics = {channel.topic for channel in needed}
    for path in parts:
        for message in messages_of(path, contents):
            unit, _, topic = message.topic.partition("/")
            if topic in topics:
                yield RawMessage(unit, topic, message.payload, message.time_ns / NANO)


def events_of(recording: Recording, started_s: float) -> list[LoggedEvent]:
    """Events of a recorded flight in order; their times count from `started_s` of the recording."""
    feed = EventFeed()
    return [
        event
        for arrived_s, unit, message in recording.in_order(EVENT_CHANNELS)
        for event in feed.take(unit, message, arrived_s - started_s)
    ]
