"""Reads the raw recordings of a Vicon gateway, see `rcopterx.vicon_gateway.recording`."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO, NamedTuple

from rcopterx.vicon_gateway.recording import FILE_MAGIC, RECORD, RawEvent

MAX_RECORD_BYTES = 16 * 1024 * 1024


class RawRecordingError(ValueError):
    """The file is not a raw recording."""


class RawRecord(NamedTuple):
    """One record of the file."""

    time_s: float
    event: RawEvent
    data: bytes


def read_records(source: BinaryIO) -> Iterator[RawRecord]:
    """Yield the records of a recording; `RawRecordingError` if it is none, damaged, or a record too long."""
    if source.read(len(FILE_MAGIC)) != FILE_MAGIC:
        raise RawRecordingError(f"not a raw DataStream recording: it does not start with {FILE_MAGIC!r}")
    while len(header := source.read(RECORD.size)) == RECORD.size:
        time_s, event, size = RECORD.unpack(header)
        if event not in RawEvent.__members__.values() or size > MAX_RECORD_BYTES:
            raise RawRecordingError(f"damaged recording: event {event} with {size} bytes")
        data = source.read(size)
        if len(data) < size:
            return
        yield RawRecord(time_s, RawEvent(event), data)


@dataclass(slots=True)
class RecordedConnection:
    """One connection of a recording: chunks with seconds since its opening, and when it ended."""

    chunks: list[tuple[float, bytes]] = field(default_factory=list)
    ended_after_s: float | None = None


def connections(records: Iterable[RawRecord]) -> list[RecordedConnection]:
    """Group records by connection."""
    found: list[RecordedConnection] = []
    opened_s = 0.0
    for record in records:
        if record.event is RawEvent.OPENED:
            found.append(RecordedConnection())
            opened_s = record.time_s
        elif not found:
            raise RawRecordingError("damaged recording: it does not begin with an opened connection")
        elif record.event is RawEvent.RECEIVED:
            found[-1].chunks.append((record.time_s - opened_s, record.data))
        else:
            found[-1].ended_after_s = record.time_s - opened_s
    return found
