"""Control objects of the DataStream protocol (Vicon DataStream SDK), and the catalogue of types.

Every object is a frozen dataclass with its type number `KIND`, `payload()` to encode and `parse(payload)` to
decode; `parse` raises `WireError` and nothing else. Data objects are in `objects`.
"""

import struct
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import ClassVar, Self

from rcopterx.vicon_gateway.wire import PayloadReader, encode_object, encode_packet, encode_u32_set

_U32 = struct.Struct("<I")


class ObjectType(IntEnum):
    """Type numbers of the objects this package knows; a reader skips all others."""

    STREAM_INFO = 1
    SUBJECT_INFO = 2
    FRAME_INFO = 5
    LABELED_RECONS = 6
    UNLABELED_RECONS = 7
    LOCAL_SEGMENTS = 8
    GLOBAL_SEGMENTS = 9
    TIMECODE = 23
    LATENCY_INFO = 26
    SUBJECT_TOPOLOGY = 28
    SUBJECT_HEALTH = 29
    HARDWARE_FRAME_INFO = 36
    APPLICATION_INFO = 37
    FRAME_RATE_INFO = 39
    OBJECT_QUALITY = 40
    PING = 42
    LIGHTWEIGHT_SEGMENTS = 901
    SUBJECT_SCALE = 28001
    OBJECT_ENUMS = 100001
    REQUEST_FRAME = 100002
    KEEP_ALIVE = 100003
    CONTENTS = 100004
    FILTER = 100007
    REQUEST_NEXT_FRAME = 100008


STATIC_TYPES = frozenset(
    int(kind)
    for kind in (
        ObjectType.STREAM_INFO,
        ObjectType.SUBJECT_INFO,
        ObjectType.SUBJECT_TOPOLOGY,
        ObjectType.SUBJECT_SCALE,
        ObjectType.SUBJECT_HEALTH,
        ObjectType.APPLICATION_INFO,
        ObjectType.OBJECT_QUALITY,
    )
)
"""Static types: kept until a packet carries any object of this class."""

DYNAMIC_TYPES = frozenset(
    int(kind)
    for kind in (
        ObjectType.FRAME_INFO,
        ObjectType.LABELED_RECONS,
        ObjectType.UNLABELED_RECONS,
        ObjectType.LOCAL_SEGMENTS,
        ObjectType.GLOBAL_SEGMENTS,
        ObjectType.LIGHTWEIGHT_SEGMENTS,
        ObjectType.TIMECODE,
        ObjectType.LATENCY_INFO,
        ObjectType.HARDWARE_FRAME_INFO,
        ObjectType.FRAME_RATE_INFO,
    )
)
"""Dynamic types: rebuilt by every packet."""


class WireObject:
    """Base of all objects: a type number and a payload."""

    __slots__ = ()
    KIND: ClassVar[ObjectType]

    def payload(self) -> bytes:
        """Return the encoded payload; objects without fields have none."""
        return b""

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload, surplus bytes at its end ignored; raises `WireError`."""
        del payload
        return cls()

    def encode(self) -> bytes:
        """Return the object with its header."""
        return encode_object(self.KIND, self.payload())


class FixedObject(WireObject):
    """An object whose fields have a fixed layout, in their order."""

    __slots__ = ()
    __match_args__: ClassVar[tuple[str, ...]]
    LAYOUT: ClassVar[struct.Struct]

    def payload(self) -> bytes:
        """Return the encoded payload."""
        return self.LAYOUT.pack(*[getattr(self, name) for name in self.__match_args__])

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        new: Callable[..., Self] = cls
        return new(*PayloadReader(payload).take(cls.LAYOUT))


def packet(*objects: WireObject) -> bytes:
    """Return one packet with these objects in this order."""
    return encode_packet(*(item.encode() for item in objects))


@dataclass(frozen=True, slots=True)
class ObjectEnums(WireObject):
    """The server's offer, or the client's selection out of it."""

    KIND: ClassVar[ObjectType] = ObjectType.OBJECT_ENUMS
    types: frozenset[int] = frozenset()

    def payload(self) -> bytes:
        """Return the encoded payload."""
        return encode_u32_set(self.types)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        return cls(frozenset(PayloadReader(payload).u32_list()))


@dataclass(frozen=True, slots=True)
class RequestFrame(FixedObject):
    """Streaming: push every frame from now on. Otherwise: stop pushing and send one frame."""

    KIND: ClassVar[ObjectType] = ObjectType.REQUEST_FRAME
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<?")
    streaming: bool


@dataclass(frozen=True, slots=True)
class RequestNextFrame(FixedObject):
    """Ask for the next `number` frames, each as soon as it is captured (SDK 1.9 and later)."""

    KIND: ClassVar[ObjectType] = ObjectType.REQUEST_NEXT_FRAME
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<I")
    number: int = 1


@dataclass(frozen=True, slots=True)
class KeepAlive(WireObject):
    """No content; clients ignore it."""

    KIND: ClassVar[ObjectType] = ObjectType.KEEP_ALIVE


@dataclass(frozen=True, slots=True)
class Contents(WireObject):
    """Contents of a frame packet: objects per selected type, and types left out because unchanged."""

    KIND: ClassVar[ObjectType] = ObjectType.CONTENTS
    counts: Mapping[int, int] = field(default_factory=dict)
    unchanged: frozenset[int] = frozenset()

    def payload(self) -> bytes:
        """Return the encoded payload."""
        flat = tuple(number for pair in sorted(self.counts.items()) for number in pair)
        return struct.pack(f"<I{len(flat)}I", len(flat) // 2, *flat) + encode_u32_set(self.unchanged)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        counts = {reader.u32(): reader.u32() for _ in range(reader.count(8))}
        return cls(counts, frozenset(reader.u32_list()))


@dataclass(frozen=True, slots=True)
class Ping(FixedObject):
    """Echoed by the server at once, in a packet of its own."""

    KIND: ClassVar[ObjectType] = ObjectType.PING
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<Q")
    number: int


@dataclass(frozen=True, slots=True)
class Filter(WireObject):
    """For the named types send only objects of these subject (or camera) ids."""

    KIND: ClassVar[ObjectType] = ObjectType.FILTER
    allowed: Mapping[int, frozenset[int]] = field(default_factory=dict)

    def payload(self) -> bytes:
        """Return the encoded payload."""
        entries = (_U32.pack(kind) + encode_u32_set(ids) for kind, ids in sorted(self.allowed.items()))
        return _U32.pack(len(self.allowed)) + b"".join(entries)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        return cls({reader.u32(): frozenset(reader.u32_list()) for _ in range(reader.count(8))})


CONTROL_OBJECTS: tuple[type[WireObject], ...] = (
    ObjectEnums,
    RequestFrame,
    RequestNextFrame,
    KeepAlive,
    Contents,
    Ping,
    Filter,
)


def offer_packet(types: Iterable[int]) -> bytes:
    """Return the packet with which a server introduces itself."""
    return packet(ObjectEnums(frozenset(types)))
