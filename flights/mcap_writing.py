"""Writes an MCAP file (https://mcap.dev/spec) in small chunks, each complete on disk before the next begins.

The writer of the library `mcap` ends a chunk by its size only. Here the recorder ends it by time, so that it
loses no more than the last fifth of a second when it is killed. Chunks have no index of their messages: it
would take a tenth of the file.
"""

import zlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from struct import Struct
from typing import BinaryIO, Final, NamedTuple

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

MAGIC: Final = b"\x89MCAP0\r\n"
LIBRARY: Final = "rcopterx"
JSON: Final = "application/json"
COMPRESSION: Final = "zstd"
COMPRESSION_LEVEL: Final = 6  # of 1 (fast) to 22 (small)
_MESSAGE: Final = Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_MESSAGE_FIXED: Final = 22  # bytes of a message record between its length and its data
_FOOTER_CHECKED: Final = Struct("<BQQQ")


class LoggedMessage(NamedTuple):
    """One message of a flight log."""

    topic: str  # unit and topic of the channel, for instance `h1/pose`
    payload: bytes
    time_ns: int  # arrival: wall clock at the recorder's start plus monotonic time since
    number: int  # counter of the sender or 0


class McapFile:
    """One file under construction; every chunk is flushed.

    `schemas` has names and JSON schemas by topic (`tracker/status`), else by its last part (`pose`).
    """

    def __init__(self, file: BinaryIO, schemas: Mapping[str, tuple[str, bytes]]) -> None:
        self._file = file
        self._schemas = schemas
        self._compressor = zstandard.ZstdCompressor(level=COMPRESSION_LEVEL)
        self._channels: dict[str, Channel] = {}
        self._schema_records: dict[str, Schema] = {}
        # As bytes: there are ten a second.
        self._chunk_indexes = RecordBuilder()
        self.chunks = 0
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: Counter[int] = Counter()
        self._start_ns: int | None = None
        self._end_ns = 0
        self.written_bytes = 0  # whole records only
        head = RecordBuilder()
        head.write(MAGIC)
        Header(profile="", library=LIBRARY).write(head)
        self._write(head.end())

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a table of texts."""
        offset, length = self._write_record(Metadata(name, dict(values)))
        self._metadata.append(MetadataIndex(offset=offset, length=length, name=name))

    def add_attachment(self, name: str, data: bytes, time_ns: int) -> None:
        """Add a JSON document."""
        offset, length = self._write_record(Attachment(time_ns, time_ns, name, JSON, data))
        self._attachments.append(AttachmentIndex(offset, length, time_ns, time_ns, len(data), name, JSON))

    def add_chunk(self, messages: Sequence[LoggedMessage]) -> None:
        """Write one compressed chunk; after an OSError `written_bytes` is the end of the whole records."""
        if not messages:
            return
        builder = RecordBuilder()
        parts: list[bytes] = []
        counts: Counter[int] = Counter()
        for message in messages:
            channel = self._channels.get(message.topic) or self._declare(message.topic, builder)
            time_ns, length = message.time_ns, _MESSAGE_FIXED + len(message.payload)
            head = _MESSAGE.pack(Opcode.MESSAGE, length, channel.id, message.number, time_ns, time_ns)
            parts += (builder.end(), head, message.payload)
            counts[channel.id] += 1
        times = [message.time_ns for message in messages]
        self._write_chunk(b"".join(parts), min(times), max(times))
        self._counts.update(counts)

    def _declare(self, topic: str, builder: RecordBuilder) -> Channel:
        """Channel of a topic, with its schema; their records precede its first message."""
        kind = topic if topic in self._schemas else topic.rpartition("/")[2]
        schema_id = 0
        if kind in self._schemas:
            schema = self._schema_records.get(kind)
            if schema is None:
                name, data = self._schemas[kind]
                schema = Schema(id=len(self._schema_records) + 1, data=data, encoding="jsonschema", name=name)
                self._schema_records[kind] = schema
                schema.write(builder)
            schema_id = schema.id
        channel = Channel(len(self._channels) + 1, topic, "msgpack", {}, schema_id)
        self._channels[topic] = channel
        channel.write(builder)
        return channel

    def _write_chunk(self, data: bytes, start_ns: int, end_ns: int) -> None:
        compressed = self._compressor.compress(data)
        chunk = Chunk(COMPRESSION, compressed, end_ns, start_ns, zlib.crc32(data), len(data))
        offset, length = self._write_record(chunk)
        self._start_ns = start_ns if self._start_ns is None else min(self._start_ns, start_ns)
        self._end_ns = max(self._end_ns, end_ns)
        self.chunks += 1
        ChunkIndex(
            chunk_length=length, chunk_start_offset=offset, compression=COMPRESSION,
            compressed_size=len(compressed), message_end_time=end_ns,
            message_index_length=0, message_index_offsets={},
            message_start_time=start_ns, uncompressed_size=len(data),
        ).write(self._chunk_indexes)  # fmt: skip

    def _write_record(self, record: McapRecord) -> tuple[int, int]:
        """Write one record; return its offset and length."""
        offset = self.written_bytes
        self._write(_records([record]))
        return offset, self.written_bytes - offset

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self._file.flush()
        self.written_bytes += len(data)

    def finish(self) -> None:
        """Write the summary, which completes the file."""
        self._write_record(DataEnd(0))
        start = self.written_bytes
        parts, offsets, length = [], RecordBuilder(), 0
        for opcode, records in self._summary():
            if records:
                SummaryOffset(opcode, start + length, len(records)).write(offsets)
            parts.append(records)
            length += len(records)
        offset_start = start + length
        summary = b"".join([*parts, offsets.end()])
        checked = _FOOTER_CHECKED.pack(Opcode.FOOTER, 8 + 8 + 4, start, offset_start)
        foot = RecordBuilder()
        Footer(start, offset_start, zlib.crc32(checked, zlib.crc32(summary))).write(foot)
        self._write(summary + foot.end() + MAGIC)

    def _summary(self) -> list[tuple[Opcode, bytes]]:
        statistics = Statistics(
            attachment_count=len(self._attachments), channel_count=len(self._channels),
            channel_message_counts=dict(self._counts), chunk_count=self.chunks,
            message_count=sum(self._counts.values()), metadata_count=len(self._metadata),
            message_start_time=self._start_ns or 0, message_end_time=self._end_ns,
            schema_count=len(self._schema_records),
        )  # fmt: skip
        return [
            (Opcode.SCHEMA, _records(self._schema_records.values())),
            (Opcode.CHANNEL, _records(self._channels.values())),
            (Opcode.STATISTICS, _records([statistics])),
            (Opcode.CHUNK_INDEX, self._chunk_indexes.end()),
            (Opcode.ATTACHMENT_INDEX, _records(self._attachments)),
            (Opcode.METADATA_INDEX, _records(self._metadata)),
        ]


def _records(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())
