"""Walks through the records of an MCAP file; behind damage it continues at the next intact record."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import BinaryIO, Final, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, ChunkIndex, Metadata, MetadataIndex, Statistics

from rcopterx.bus.clock import NANO

MAGIC: Final = b"\x89MCAP0\r\n"
COMPRESSION: Final = "zstd"
MAX_RECORD_BYTES: Final = 256 * 1024 * 1024
MAX_CHUNK_BYTES: Final = 64 * 1024 * 1024  # Decompressed. The recorder writes some kilobytes.
SIZE_UNKNOWN: Final = -1  # size of a frame of zstandard that declares none
MALFORMED: Final = (McapError, struct.error, UnicodeDecodeError, OverflowError)  # by contradictory records
WINDOW_BYTES: Final = 1024 * 1024  # of a file that is searched at once for the next chunk
HEAD: Final = struct.Struct("<BQ")  # opcode, length
_CHUNK: Final = struct.Struct("<QQQII")  # first, last time; size; checksum; length of the compression name
_LENGTH: Final = struct.Struct("<Q")
_CHECKSUM: Final = struct.Struct("<I")
_FOOTER: Final = struct.Struct("<BQQQI")  # opcode, length, start of the summary, of its offsets, checksum
_NAME: Final = struct.pack("<I4s", len(COMPRESSION), COMPRESSION.encode())  # as it stands in a chunk
_NAME_AT: Final = HEAD.size + _CHUNK.size - _CHECKSUM.size
_DATA_END_BYTES: Final = HEAD.size + _CHECKSUM.size


class FlightLogError(ValueError):
    """The file is not a flight log, or cannot be read; says which one and why."""


class McapRecord(NamedTuple):
    """An intact record; the content of a chunk is its records, decompressed."""

    opcode: int
    content: bytes
    start: int
    end: int  # the byte behind it
    checksum: int = 0  # of its bytes and all before
    span_ns: tuple[int, int] = (0, 0)  # times of the first and the last message of a chunk


class Summary(NamedTuple):
    """What the end of a complete file repeats."""

    start: int
    channels: dict[int, str]
    offsets: list[int]  # of chunks, attachments and metadata, in order
    messages: int


class RecordWalk:
    """Yields the intact records of a file up to its summary; then `complete` and `missing` are known."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._size = file.seek(0, 2)
        self.complete = False  # whether the recorder has finished the file and every bit of it is right
        self.missing: list[str] = []  # sentences about damaged places and what was there
        self._first_ns = self._last_ns = 0

    def __iter__(self) -> Iterator[McapRecord]:
        self._file.seek(0)
        begins = self._file.read(len(MAGIC)) == MAGIC
        at, checksum = len(MAGIC) if begins else 0, zlib.crc32(MAGIC)
        if not self._size:
            raise FlightLogError("not an MCAP file")
        while at < self._size:
            record = self._record_at(at, checksum) if begins else None
            if record is None:
                if (record := self._resumed(at)) is None:
                    if not begins:
                        raise FlightLogError("not an MCAP file")
                    return
                begins = True
            if record.opcode == Opcode.CHUNK:
                self._first_ns, self._last_ns = self._first_ns or record.span_ns[0], record.span_ns[1]
            elif record.opcode == Opcode.DATA_END:
                self._end(record, checksum)
                return
            yield record
            at, checksum = record.end, record.checksum

    def _end(self, record: McapRecord, checksum: int) -> None:
        summary = _summary_bytes(self._file, self._size)
        (declared,) = _CHECKSUM.unpack(record.content)
        if self.missing:
            return
        if summary is None or summary[0] != record.end:
            self.missing.append(f"byte {record.end} and following: the summary is damaged, no messages")
        elif declared not in (0, checksum):
            self.missing.append("its checksum is wrong: bits outside of the messages are damaged")
        self.complete = not self.missing

    def _record_at(self, at: int, checksum: int) -> McapRecord | None:
        self._file.seek(at)
        head = self._file.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        opcode, length = HEAD.unpack(head)
        end = at + HEAD.size + length
        if length > MAX_RECORD_BYTES or end > self._size:
            return None
        body = self._file.read(length)
        if (content := _intact(opcode, body)) is None:
            return None
        checksum = zlib.crc32(body, zlib.crc32(head, checksum))
        return McapRecord(
            opcode, content, at, end, checksum, _span_ns(body) if opcode == Opcode.CHUNK else (0, 0)
        )

    def _resumed(self, at: int) -> McapRecord | None:
        """Return the next intact record from a damaged place on, and note the gap."""
        summary = summary_at_end(self._file)
        known = [*summary.offsets, summary.start - _DATA_END_BYTES]
        found = next(filter(None, (self._record_at(start, 0) for start in known if start > at)), None)
        # The places of the summary are wrong in a file that has lost or gained bytes.
        record = self._next_chunk(at, self._size if found is None else found.start) or found
        end = self._size if record is None else record.start
        if end == at:
            self.missing.append(f"byte {at}: the head of a chunk is damaged, its messages are intact")
        else:
            first_ns = 0 if record is None else record.span_ns[0]
            self.missing.append(f"bytes {at} to {end} are damaged or half written: {self._when(first_ns)}")
        return record

    def _when(self, next_ns: int) -> str:
        """Return when messages of a damaged place arrived, between the chunks beside it."""
        if not self._last_ns:
            return "the start of the file"
        after_s = (self._last_ns - self._first_ns) / NANO
        if not next_ns:
            return f"messages after {after_s:.2f} s of the file"
        return f"messages between {after_s:.2f} and {(next_ns - self._first_ns) / NANO:.2f} s of the file"

    def _next_chunk(self, at: int, limit: int) -> McapRecord | None:
        """Return the first chunk that begins in a range, recognised by its compression and its checksum."""
        while at < limit:
            self._file.seek(at)
            window = self._file.read(WINDOW_BYTES)
            name_at = window.find(_NAME, _NAME_AT)
            while name_at >= 0:
                start = at + name_at - _NAME_AT
                record = self._chunk_at(start) if start < limit else None
                if record is not None:
                    return record
                name_at = window.find(_NAME, name_at + 1)
            if len(window) < WINDOW_BYTES:
                return None
            at += WINDOW_BYTES - _NAME_AT - len(_NAME) + 1
        return None

    def _chunk_at(self, start: int) -> McapRecord | None:
        """Return a chunk whatever its head declares."""
        self._file.seek(start + HEAD.size)
        fixed = self._file.read(_CHUNK.size + len(COMPRESSION) + _LENGTH.size)
        if len(fixed) < _CHUNK.size + len(COMPRESSION) + _LENGTH.size:
            return None
        (length,) = _LENGTH.unpack_from(fixed, _CHUNK.size + len(COMPRESSION))
        end = self._file.tell() + length
        if length > MAX_RECORD_BYTES or end > self._size:
            return None
        content = chunk_data(fixed + self._file.read(length))
        return None if content is None else McapRecord(Opcode.CHUNK, content, start, end, 0, _span_ns(fixed))


def _intact(opcode: int, body: bytes) -> bytes | None:
    """Return the content of a record that stands outside of the summary; None if it is damaged."""
    match opcode:
        case Opcode.CHUNK:
            return chunk_data(body)
        case Opcode.ATTACHMENT:
            whole = len(body) > _CHECKSUM.size
            (declared,) = _CHECKSUM.unpack(body[-_CHECKSUM.size :]) if whole else (0,)
            return body if whole and declared in (0, zlib.crc32(body[: -_CHECKSUM.size])) else None
        case Opcode.METADATA:
            stream = stream_of(body)
            try:
                Metadata.read(stream)
            except MALFORMED:
                return None
            return body if stream.count == len(body) else None
        case Opcode.DATA_END:
            return body if len(body) == _CHECKSUM.size else None
        case Opcode.HEADER | Opcode.SCHEMA | Opcode.CHANNEL | Opcode.MESSAGE | Opcode.MESSAGE_INDEX:
            return body
        case _:
            return None


def _span_ns(body: bytes) -> tuple[int, int]:
    first_ns, last_ns, *_ = _CHUNK.unpack_from(body)
    return first_ns, last_ns


def chunk_data(body: bytes) -> bytes | None:
    """Return the records of a chunk; None where its checksum or a size that it declares is wrong."""
    if len(body) < _CHUNK.size + _LENGTH.size:
        return None
    _, _, size, checksum, name_length = _CHUNK.unpack_from(body)
    start = _CHUNK.size + name_length + _LENGTH.size
    if start > len(body) or _LENGTH.unpack_from(body, start - _LENGTH.size) != (len(body) - start,):
        return None
    compression, data = body[_CHUNK.size : start - _LENGTH.size], body[start:]
    if compression == b"lz4":
        raise FlightLogError(f"compression 'lz4', ours is {COMPRESSION!r}")
    if compression not in (b"", COMPRESSION.encode()):
        return None
    try:
        if compression:
            # zstandard allocates the size in the frame, whatever the maximum that it is given.
            sizes = {size, zstandard.frame_content_size(data)} - {SIZE_UNKNOWN}
            if len(sizes) > 1 or max(sizes) > MAX_CHUNK_BYTES:
                return None
            data = zstandard.decompress(data, size)
    except zstandard.ZstdError:
        return None
    return data if zlib.crc32(data) == checksum else None


def _summary_bytes(file: BinaryIO, size: int) -> tuple[int, bytes] | None:
    """Return place and bytes of the summary of a file; None without an intact one."""
    footer_at = size - len(MAGIC) - _FOOTER.size
    if footer_at < 0:
        return None
    file.seek(footer_at)
    footer, magic = file.read(_FOOTER.size), file.read(len(MAGIC))
    opcode, length, start, _, checksum = _FOOTER.unpack(footer)
    start = start or footer_at
    if (opcode, length, magic) != (Opcode.FOOTER, _FOOTER.size - HEAD.size, MAGIC) or start > footer_at:
        return None
    file.seek(start)
    data = file.read(footer_at - start)
    found = zlib.crc32(footer[: -_CHECKSUM.size], zlib.crc32(data))
    return (start, data) if checksum in (0, found) else None


def summary_at_end(file: BinaryIO) -> Summary:
    """Return the summary of a file, also if what precedes it is damaged; empty without one."""
    size = file.seek(0, 2)
    start, data = _summary_bytes(file, size) or (size, b"")
    summary, at = Summary(start, {}, [], 0), 0
    try:
        while at < len(data):
            opcode, length = HEAD.unpack_from(data, at)
            stream = stream_of(data[at + HEAD.size : at + HEAD.size + length])
            at += HEAD.size + length
            match opcode:
                case Opcode.CHANNEL:
                    channel = Channel.read(stream)
                    summary.channels[channel.id] = channel.topic
                case Opcode.CHUNK_INDEX:
                    summary.offsets.append(ChunkIndex.read(stream).chunk_start_offset)
                case Opcode.ATTACHMENT_INDEX:
                    summary.offsets.append(AttachmentIndex.read(stream).offset)
                case Opcode.METADATA_INDEX:
                    summary.offsets.append(MetadataIndex.read(stream).offset)
                case Opcode.STATISTICS:
                    summary = summary._replace(messages=Statistics.read(stream).message_count)
    except MALFORMED:
        return Summary(start, {}, [], 0)
    summary.offsets.sort()
    return summary


def stream_of(data: bytes) -> ReadDataStream:
    """Return the bytes of a record as a stream for the library of the format."""
    return ReadDataStream(BytesIO(data))
