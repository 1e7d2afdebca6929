"""Writes an MCAP file (https://mcap.dev/spec) in small chunks, each complete on disk before the next begins.

The recorder ends a chunk by time, not by size, so that it loses no more than the last fifth of a second when
it is killed. Chunks have no index of their messages: it would take a tenth of the file.
"""

import sys
from collections.abc import Mapping, Sequence
from functools import cache
from typing import BinaryIO, Final, NamedTuple

import msgspec
from mcap.writer import IndexType, Writer

from rcopterx.bus.channels import CHANNELS, FIXED_UNITS

LIBRARY: Final = "rcopterx"
JSON: Final = "application/json"


@cache
def schemas() -> dict[str, tuple[str, bytes]]:
    """Return name and JSON schema of messages by topic, or by unit and topic where it has several."""
    found: dict[str, tuple[str, bytes]] = {}
    for channel in CHANNELS:
        shape = msgspec.json.encode(msgspec.json.schema(channel.message))
        key = f"{channel.unit}/{channel.topic}" if channel.unit in FIXED_UNITS else channel.topic
        found[key] = (f"rcopterx.{channel.message.__name__}", shape)
    return found


class LoggedMessage(NamedTuple):
    """One message of a flight log."""

    topic: str  # unit and topic of the channel, for instance `h1/pose`
    payload: bytes
    time_ns: int  # arrival: wall clock at the recorder's start plus monotonic time since
    number: int  # counter of the sender or 0


class McapFile:
    """One file under construction; every chunk is flushed."""

    def __init__(self, file: BinaryIO) -> None:
        self.file = file
        self._writer = Writer(
            file, chunk_size=sys.maxsize, index_types=IndexType.ALL ^ IndexType.MESSAGE, enable_data_crcs=True
        )
        self._writer.start(library=LIBRARY)
        self._tables: list[tuple[str, dict[str, str]]] = []
        self._documents: list[tuple[str, bytes, int]] = []
        self._channel_ids: dict[str, int] = {}
        self._schema_ids: dict[str, int] = {}
        self.chunks = 0
        self.written_bytes = 0  # whole records only

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a table of texts."""
        self._tables.append((name, dict(values)))
        self._writer.add_metadata(name, dict(values))
        self._flush()

    def add_attachment(self, name: str, data: bytes, time_ns: int) -> None:
        """Add a JSON document."""
        self._documents.append((name, data, time_ns))
        self._writer.add_attachment(time_ns, time_ns, name, JSON, data)
        self._flush()

    def add_chunk(self, messages: Sequence[LoggedMessage]) -> None:
        """Write one compressed chunk; after an OSError the file is good up to `written_bytes` only."""
        for topic, payload, time_ns, number in messages:
            channel_id = self._channel_ids.get(topic) or self._declare(topic)
            self._writer.add_message(channel_id, time_ns, payload, time_ns, number)
        self._flush()
        self.chunks += 1

    def _flush(self) -> None:
        self._writer.flush()
        self.written_bytes = self.file.tell()

    def _declare(self, topic: str) -> int:
        """Register a topic and its schema, which precede its first message; return the channel."""
        known = schemas()
        kind = topic if topic in known else topic.rpartition("/")[2]
        if kind in known and kind not in self._schema_ids:
            name, schema = known[kind]
            self._schema_ids[kind] = self._writer.register_schema(name, "jsonschema", schema)
        channel_id: int = self._writer.register_channel(topic, "msgpack", self._schema_ids.get(kind, 0))
        self._channel_ids[topic] = channel_id
        return channel_id

    def finish(self) -> None:
        """Repeat tables and documents, which survive damage at the start, and write the summary."""
        for name, values in self._tables:
            self._writer.add_metadata(name, values)
        for name, data, time_ns in self._documents:
            self._writer.add_attachment(time_ns, time_ns, name, JSON, data)
        self._writer.finish()
        self.written_bytes = self.file.tell()
