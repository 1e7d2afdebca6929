"""Reads MCAP files of flight logs, also those that were cut off when the recorder was killed."""

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Final

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata

from rcopterx.flights.mcap_writing import LoggedMessage

MAGIC: Final = b"\x89MCAP0\r\n"
COMPRESSION: Final = "zstd"
MAX_RECORD_BYTES: Final = 256 * 1024 * 1024
MAX_CHUNK_BYTES: Final = 64 * 1024 * 1024  # Decompressed. The recorder writes some kilobytes.
SIZE_UNKNOWN: Final = -1  # size of a frame of zstandard that declares none
MALFORMED: Final = (McapError, struct.error, UnicodeDecodeError, OverflowError)
"""Raised by the library for records that contradict themselves."""
_HEAD: Final = struct.Struct("<BQ")
_MESSAGE: Final = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time


class FlightLogError(ValueError):
    """The file is not a flight log, or cannot be read; says which one and why."""


@dataclass
class Contents:
    """Metadata and attachments of a file, once its messages are read; `damaged_chunks` are left out."""

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    complete: bool = False
    damaged_chunks: int = 0


def records_of(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and bytes of every whole record of an MCAP file, up to where it is cut off."""
    if file.read(len(MAGIC)) != MAGIC:
        raise FlightLogError("not an MCAP file")
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        opcode, length = _HEAD.unpack(head)
        if length > MAX_RECORD_BYTES:
            return
        body = file.read(length)
        if len(body) < length:
            return
        yield opcode, body
        if opcode == Opcode.FOOTER:
            return


def messages_of(path: Path, contents: Contents | None = None) -> Iterator[LoggedMessage]:
    """Yield the messages of a file in order of recording, filling `contents`; or `FlightLogError`."""
    contents = Contents() if contents is None else contents
    channels: dict[int, str] = {}
    with _opened(path) as file:
        for opcode, body in records_of(file):
            if opcode == Opcode.CHUNK:
                yield from _messages(body, channels, contents)
            else:
                _note(opcode, body, contents)


def contents_of(path: Path) -> Contents:
    """Return metadata and attachments of a file without reading messages; errors as in `messages_of`."""
    contents = Contents()
    with _opened(path) as file:
        for opcode, body in records_of(file):
            _note(opcode, body, contents)
    return contents


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


def _note(opcode: int, body: bytes, contents: Contents) -> None:
    if opcode == Opcode.METADATA:
        metadata = Metadata.read(_stream(body))
        contents.metadata[metadata.name] = metadata.metadata
    elif opcode == Opcode.ATTACHMENT:
        attachment = Attachment.read(_stream(body))
        contents.attachments[attachment.name] = attachment.data
    elif opcode == Opcode.FOOTER:
        contents.complete = True


def _messages(body: bytes, channels: dict[int, str], contents: Contents) -> Iterator[LoggedMessage]:
    data = chunk_data(body)
    if data is None:
        contents.damaged_chunks += 1
        return
    start = 0
    while start < len(data):
        opcode, length = _HEAD.unpack_from(data, start)
        start += _HEAD.size
        if opcode == Opcode.CHANNEL:
            channel = Channel.read(_stream(data[start : start + length]))
            channels[channel.id] = channel.topic
        elif opcode == Opcode.MESSAGE:
            channel_id, number, time_ns, _ = _MESSAGE.unpack_from(data, start)
            # Channels that were declared in a damaged chunk are not known.
            if channel_id in channels:
                payload = data[start + _MESSAGE.size : start + length]
                yield LoggedMessage(channels[channel_id], payload, time_ns, number)
        start += length


def chunk_data(body: bytes) -> bytes | None:
    """Return the records of a chunk; None where its checksum or a size that it declares is wrong."""
    try:
        chunk = Chunk.read(_stream(body))
    except MALFORMED:
        return None
    if chunk.compression not in ("", COMPRESSION):
        raise FlightLogError(f"compression {chunk.compression!r}, ours is {COMPRESSION!r}")
    try:
        data = chunk.data
        if chunk.compression:
            # zstandard allocates the size in the frame, whatever the maximum that it is given.
            sizes = {chunk.uncompressed_size, zstandard.frame_content_size(data)} - {SIZE_UNKNOWN}
            if len(sizes) > 1 or max(sizes) > MAX_CHUNK_BYTES:
                return None
            data = zstandard.decompress(data, chunk.uncompressed_size)
    except zstandard.ZstdError:
        return None
    return data if zlib.crc32(data) == chunk.uncompressed_crc else None


def _stream(data: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(data))
