"""Raw recordings of the TCP stream: the fixture a user sends with a bug report.

File format, all numbers little-endian::

    file   = 8 bytes "RCXRAW1\\n" | record*
    record = f64 time_s | u8 event | u32 length | length bytes

`time_s` is the recorder's monotonic clock. Event 0: a connection was opened (no bytes); 1: bytes received;
2: the connection ended (the reason as UTF-8 text). A file cut in the middle of a record, as after a crash,
is read up to the last whole record.
"""

import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from typing import BinaryIO, NamedTuple, Protocol

FILE_MAGIC = b"RCXRAW1\n"
MAX_RECORD_BYTES = 16 * 1024 * 1024
_RECORD = struct.Struct("<dBI")


class RecordingError(ValueError):
    """The file is not a raw recording."""


class RawEvent(IntEnum):
    """Kind of a record."""

    OPENED = 0
    RECEIVED = 1
    ENDED = 2


class RawRecord(NamedTuple):
    """One record of the file."""

    time_s: float
    event: RawEvent
    data: bytes


class Sink(Protocol):
    """Destination of a recording: a file opened for writing bytes, or an object like one."""

    def write(self, data: bytes, /) -> object:
        """Take bytes; raises OSError when it cannot."""

    def flush(self) -> object:
        """Make sure that the bytes taken so far are kept."""


class RawRecorder:
    """Writes a recording; the first failure of the file ends it and is kept in `error`, nothing is raised."""

    def __init__(self, sink: Sink, clock: Callable[[], float]) -> None:
        self._sink = sink
        self._clock = clock
        self.error: str | None = None
        self.recorded_bytes = 0
        self._write(FILE_MAGIC)

    def opened(self) -> None:
        """Note that a connection was opened."""
        self._record(RawEvent.OPENED, b"")

    def received(self, data: bytes) -> None:
        """Store received bytes."""
        self._record(RawEvent.RECEIVED, data)

    def ended(self, reason: str) -> None:
        """Note that the connection ended, and flush the file."""
        self._record(RawEvent.ENDED, reason.encode())
        self._guard(self._sink.flush)

    def _record(self, event: RawEvent, data: bytes) -> None:
        self._write(_RECORD.pack(self._clock(), event, len(data)) + data)

    def _write(self, data: bytes) -> None:
        self._guard(lambda: self._sink.write(data))
        if self.error is None:
            self.recorded_bytes += len(data)

    def _guard(self, action: Callable[[], object]) -> None:
        if self.error is not None:
            return
        try:
            action()
        except (OSError, ValueError) as error:  # ValueError: the file has been closed
            self.error = f"raw recording stopped: {error}"


def read_records(source: BinaryIO) -> Iterator[RawRecord]:
    """Yield the records of a recording.

    Raises `RecordingError` for wrong first bytes, an unknown event, or a record longer than
    `MAX_RECORD_BYTES`.
    """
    if source.read(len(FILE_MAGIC)) != FILE_MAGIC:
        raise RecordingError(f"not a raw DataStream recording: it does not start with {FILE_MAGIC!r}")
    while len(header := source.read(_RECORD.size)) == _RECORD.size:
        time_s, event, size = _RECORD.unpack(header)
        if event not in RawEvent.__members__.values() or size > MAX_RECORD_BYTES:
            raise RecordingError(f"damaged recording: event {event} with {size} bytes")
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
            raise RecordingError("damaged recording: it does not begin with an opened connection")
        elif record.event is RawEvent.RECEIVED:
            found[-1].chunks.append((record.time_s - opened_s, record.data))
        else:
            found[-1].ended_after_s = record.time_s - opened_s
    return found
