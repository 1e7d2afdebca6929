"""Framing, types of objects and coding of the Vicon DataStream protocol (Vicon DataStream SDK).

Everything that reads bytes from the network goes through this module and raises exactly one error,
`WireError`, for anything malformed. Lengths and counts are compared with the bytes that are really there
before anything is allocated.
"""

import struct
from enum import IntEnum

MAGIC = 0x1A2B0001
MAX_BODY_BYTES = 64 * 1024 * 1024
MAX_OBJECTS = 65_536  # objects in one packet; a Tracker sends a few per subject

HEADER = struct.Struct("<II")  # Of a packet: magic, body length. Of an object: type, payload length.

_MAGIC_BYTES = MAGIC.to_bytes(4, "little")
_U32 = struct.Struct("<I")


class ObjectType(IntEnum):
    """Type numbers of the objects this package knows; a reader skips all others."""

    STREAM_INFO = 1
    SUBJECT_INFO = 2
    FRAME_INFO = 5
    UNLABELED_RECONS = 7
    LOCAL_SEGMENTS = 8
    GLOBAL_SEGMENTS = 9
    TIMECODE = 23
    LATENCY_INFO = 26
    SUBJECT_TOPOLOGY = 28
    SUBJECT_HEALTH = 29
    APPLICATION_INFO = 37
    FRAME_RATE_INFO = 39
    OBJECT_QUALITY = 40
    PING = 42
    SUBJECT_SCALE = 28001
    OBJECT_ENUMS = 100001
    REQUEST_FRAME = 100002
    CONTENTS = 100004


STATIC_TYPES = frozenset(
    {
        ObjectType.STREAM_INFO,
        ObjectType.SUBJECT_INFO,
        ObjectType.SUBJECT_TOPOLOGY,
        ObjectType.SUBJECT_SCALE,
        ObjectType.SUBJECT_HEALTH,
        ObjectType.APPLICATION_INFO,
        ObjectType.OBJECT_QUALITY,
    }
)
"""Static types: kept until a packet carries any object of this class."""

_DIALOGUE = {ObjectType.OBJECT_ENUMS, ObjectType.REQUEST_FRAME, ObjectType.CONTENTS, ObjectType.PING}
DYNAMIC_TYPES = frozenset(ObjectType) - STATIC_TYPES - _DIALOGUE
"""Dynamic types: rebuilt by every packet."""


class WireError(ValueError):
    """Bytes that do not follow the DataStream wire format."""


def encode_object(kind: int, payload: bytes) -> bytes:
    """Return one object with its header: type, payload length, payload."""
    return HEADER.pack(kind, len(payload)) + payload


def encode_packet(*objects: bytes) -> bytes:
    """Return one packet around encoded objects; no objects gives the empty packet of 8 bytes."""
    body = b"".join(objects)
    return HEADER.pack(MAGIC, len(body)) + body


def split_objects(body: bytes) -> list[tuple[int, bytes]]:
    """Split a packet body into objects (type, payload), unknown ones included; may raise `WireError`."""
    objects: list[tuple[int, bytes]] = []
    position, end = 0, len(body)
    while position < end:
        start = position + 8
        if start > end:
            raise WireError(f"object header is cut: {end - position} of 8 bytes")
        kind, size = HEADER.unpack_from(body, position)
        position = start + size
        if position > end:
            raise WireError(f"object of type {kind} claims {size} bytes, {end - start} are there")
        objects.append((kind, body[start:position]))
        if len(objects) > MAX_OBJECTS:
            raise WireError(f"more than {MAX_OBJECTS} objects in one packet")
    return objects


class PacketReader:
    """Reassembles packets from bytes cut anywhere; after a `WireError` every further call raises again."""

    def __init__(self, max_body_bytes: int = MAX_BODY_BYTES) -> None:
        self._max_body_bytes = max_body_bytes
        self._buffer = bytearray()

    def feed(self, data: bytes) -> None:
        """Append received bytes."""
        self._buffer += data

    def next_body(self) -> bytes | None:
        """Return the next complete body, if any; `WireError` for a wrong magic or an excessive length."""
        buffer = self._buffer
        if buffer[:4] != _MAGIC_BYTES[: len(buffer)]:
            raise WireError(
                f"packet starts with {bytes(buffer[:4]).hex(' ')}, expected {_MAGIC_BYTES.hex(' ')}"
            )
        if len(buffer) < 8:
            return None
        size = HEADER.unpack_from(buffer)[1]
        if size > self._max_body_bytes:
            raise WireError(f"packet body of {size} bytes exceeds the limit of {self._max_body_bytes}")
        end = 8 + size
        if len(buffer) < end:
            return None
        body = bytes(buffer[8:end])
        del buffer[:end]
        return body


class PayloadReader:
    """Reads the fields of one object payload; surplus bytes at the end are allowed."""

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._position = 0

    @property
    def remaining(self) -> int:
        """Bytes not read yet."""
        return len(self._payload) - self._position

    def _advance(self, size: int) -> int:
        start = self._position
        if size > len(self._payload) - start:
            raise WireError(f"payload is cut: {size} bytes needed at {start}, {self.remaining} are there")
        self._position = start + size
        return start

    def take(self, layout: struct.Struct) -> tuple[float, ...]:
        """Read the fields of `layout`; integer codes become ints."""
        return layout.unpack_from(self._payload, self._advance(layout.size))

    def count(self, item_bytes: int) -> int:
        """Read an element count and check it against the bytes left, at least `item_bytes` per element."""
        number: int = _U32.unpack_from(self._payload, self._advance(_U32.size))[0]
        if number * item_bytes > self.remaining:
            raise WireError(
                f"{number} elements of at least {item_bytes} bytes claimed, {self.remaining} bytes left"
            )
        return number

    def string(self) -> str:
        r"""Read a string; bytes that are not UTF-8 (old Trackers in Latin-1) appear as ``\xNN``."""
        size = self.count(1)
        start = self._advance(size)
        return self._payload[start : start + size].decode("utf-8", "backslashreplace")


def encode_string(text: str) -> bytes:
    """Return a string in UTF-8 with its length in front."""
    data = text.encode()
    return _U32.pack(len(data)) + data
