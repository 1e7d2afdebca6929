"""Reads MCAP files of flight logs, also those that were cut off when the recorder was killed."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata

from rcopterx.flights.mcap_records import (
    HEAD,
    MALFORMED,
    FlightLogError,
    RecordWalk,
    stream_of,
    summary_at_end,
)
from rcopterx.flights.mcap_writing import LoggedMessage

_MESSAGE: Final = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time


@dataclass
class LogContents:
    """What a file holds besides messages, and what of it is missing, once it is read to its end."""

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    complete: bool = False
    missing: list[str] = field(default_factory=list)  # sentences about damaged places
    nameless: int = 0  # messages whose channel was declared in a damaged place
    recorded: int = 0  # messages that the summary counts, 0 without an intact one


def messages_of(path: Path, contents: LogContents | None = None) -> Iterator[LoggedMessage]:
    """Yield messages as recorded, fill `contents`, note what is damaged; may raise `FlightLogError`."""
    contents = LogContents() if contents is None else contents
    channels: dict[int, str] = {}
    with _opened(path) as file:
        for records in _chunks_of(file, contents, channels):
            yield from _messages(records, channels, contents)


def contents_of(path: Path) -> LogContents:
    """Return what a file holds besides messages, and whether it is intact; errors as in `messages_of`."""
    contents = LogContents()
    with _opened(path) as file:
        for _ in _chunks_of(file, contents, {}):
            pass
    return contents


def _chunks_of(file: BinaryIO, contents: LogContents, channels: dict[int, str]) -> Iterator[bytes]:
    """Yield the records of every intact chunk, and note everything else."""
    walk, summary = RecordWalk(file), None
    for record in walk:
        if walk.missing and summary is None:
            summary = summary_at_end(file)
            channels.update(summary.channels)
        if record.opcode == Opcode.CHUNK:
            yield record.content
        elif record.opcode == Opcode.METADATA:
            metadata = Metadata.read(stream_of(record.content))
            contents.metadata[metadata.name] = metadata.metadata
        elif record.opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(stream_of(record.content))
            contents.attachments[attachment.name] = attachment.data
    if walk.missing:
        contents.recorded = summary_at_end(file).messages
    contents.complete = walk.complete
    contents.missing += walk.missing


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """Open a file; failures to read it become `FlightLogError`."""
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise FlightLogError(f"{path}: cannot be read: {error.strerror}") from None
    except (FlightLogError, *MALFORMED) as error:
        raise FlightLogError(f"{path}: not a flight log: {error}") from None


def _messages(records: bytes, channels: dict[int, str], contents: LogContents) -> Iterator[LoggedMessage]:
    start = 0
    while start < len(records):
        opcode, length = HEAD.unpack_from(records, start)
        start += HEAD.size
        if opcode == Opcode.CHANNEL:
            channel = Channel.read(stream_of(records[start : start + length]))
            channels[channel.id] = channel.topic
        elif opcode == Opcode.MESSAGE:
            channel_id, number, time_ns, _ = _MESSAGE.unpack_from(records, start)
            if channel_id in channels:
                payload = records[start + _MESSAGE.size : start + length]
                yield LoggedMessage(channels[channel_id], payload, time_ns, number)
            else:
                contents.nameless += 1
        start += length
