"""Reads the raw recordings of a Vicon gateway, see `rcopterx.vicon_gateway.recording`."""

from dataclasses import dataclass, field
from typing import BinaryIO

from rcopterx.vicon_gateway.recording import FILE_MAGIC, RECORD, RawEvent

MAX_RECORD_BYTES = 16 * 1024 * 1024


@dataclass(slots=True)
class RecordedConnection:
    """One connection of a recording: chunks with seconds since its opening, and when it ended."""

    chunks: list[tuple[float, bytes]] = field(default_factory=list)
    ended_after_s: float | None = None


def connections(source: BinaryIO) -> list[RecordedConnection]:
    """Read the connections of a recording; `ValueError` if it is none, damaged, or a record too long."""
    if source.read(len(FILE_MAGIC)) != FILE_MAGIC:
        raise ValueError(f"not a raw DataStream recording: it does not start with {FILE_MAGIC!r}")
    found: list[RecordedConnection] = []
    opened_s = 0.0
    while len(header := source.read(RECORD.size)) == RECORD.size:
        time_s, event, size = RECORD.unpack(header)
        if event not in RawEvent.__members__.values() or size > MAX_RECORD_BYTES:
            raise ValueError(f"damaged recording: event {event} with {size} bytes")
        data = source.read(size)
        if len(data) < size:
            break
        if event == RawEvent.OPENED:
            found.append(RecordedConnection())
            opened_s = time_s
        elif not found:
            raise ValueError("damaged recording: it does not begin with an opened connection")
        elif event == RawEvent.RECEIVED:
            found[-1].chunks.append((time_s - opened_s, data))
        else:
            found[-1].ended_after_s = time_s - opened_s
    return found
