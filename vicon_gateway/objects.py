"""Objects of the DataStream protocol that a client reads or sends (Vicon DataStream SDK), in its units.

Every object is a frozen dataclass with its type number `KIND`, `payload()` to encode and `parse(payload)` to
decode; `parse` raises `WireError` and nothing else. Poses are in millimetres, right-handed, with row-major
rotation matrices that map segment to world coordinates.
"""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Self

from rcopterx.vicon_gateway.wire import (
    ObjectType,
    PayloadReader,
    encode_object,
    encode_packet,
    encode_string,
    encode_u32_set,
    split_objects,
)

SDK_TICKS_PER_SECOND = 135_000_000
"""Unit of the frame period in StreamInfo."""

Vector3 = tuple[float, float, float]
Matrix3 = tuple[float, float, float, float, float, float, float, float, float]
IDENTITY: Matrix3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

_U32 = struct.Struct("<I")
_F64 = struct.Struct("<d")
_BOUNDS = struct.Struct("<6f")
_SEGMENT = struct.Struct("<I12d")


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


@dataclass(frozen=True, slots=True)
class StreamInfo(FixedObject):
    """Frame period in ticks of 135 MHz."""

    KIND: ClassVar[ObjectType] = ObjectType.STREAM_INFO
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<q")
    period_ticks: int

    @property
    def period_s(self) -> float:
        """Frame period in seconds."""
        return self.period_ticks / SDK_TICKS_PER_SECOND


@dataclass(frozen=True, slots=True)
class SegmentInfo:
    """Description of one segment inside SubjectInfo; the root segment has parent 0."""

    parent: int
    id: int
    name: str
    bounds_mm: tuple[float, ...] = (0.0,) * 6


@dataclass(frozen=True, slots=True)
class SubjectInfo(WireObject):
    """Names and structure of one subject; `id` is the key used by all other objects."""

    KIND: ClassVar[ObjectType] = ObjectType.SUBJECT_INFO
    id: int
    name: str
    segments: tuple[SegmentInfo, ...]
    markers: tuple[tuple[int, str], ...] = ()
    attachments: tuple[tuple[int, int], ...] = ()

    @property
    def root_segment(self) -> SegmentInfo | None:
        """The segment whose parent is 0, whatever its name."""
        return next((segment for segment in self.segments if segment.parent == 0), None)

    def payload(self) -> bytes:
        """Return the encoded payload."""
        parts = [_U32.pack(self.id), encode_string(self.name), _U32.pack(len(self.segments))]
        for segment in self.segments:
            parts += [_U32.pack(segment.parent), _U32.pack(segment.id), _BOUNDS.pack(*segment.bounds_mm)]
            parts.append(encode_string(segment.name))
        parts.append(_U32.pack(len(self.markers)))
        for marker, name in self.markers:
            parts += [_U32.pack(marker), encode_string(name)]
        parts.append(_U32.pack(len(self.attachments)))
        parts += [_U32.pack(number) for pair in self.attachments for number in pair]
        return b"".join(parts)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        subject, name = reader.u32(), reader.string()
        segments = []
        for _ in range(reader.count(36)):
            parent, segment = reader.u32(), reader.u32()
            bounds = reader.take(_BOUNDS)
            segments.append(SegmentInfo(parent, segment, reader.string(), bounds))
        markers = tuple((reader.u32(), reader.string()) for _ in range(reader.count(8)))
        attachments = tuple((reader.u32(), reader.u32()) for _ in range(reader.count(8)))
        return cls(subject, name, tuple(segments), markers, attachments)


@dataclass(frozen=True, slots=True)
class FrameInfo(FixedObject):
    """Frame id counted from 0; SDK 1.11 and later report id + 1 as the frame number."""

    KIND: ClassVar[ObjectType] = ObjectType.FRAME_INFO
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<I")
    frame: int


@dataclass(frozen=True, slots=True)
class LatencyInfo(WireObject):
    """Latency of each pipeline stage in seconds; the total is their sum."""

    KIND: ClassVar[ObjectType] = ObjectType.LATENCY_INFO
    samples: tuple[tuple[str, float], ...] = ()

    def payload(self) -> bytes:
        """Return the encoded payload."""
        samples = (encode_string(name) + _F64.pack(value) for name, value in self.samples)
        return _U32.pack(len(self.samples)) + b"".join(samples)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        return cls(tuple((reader.string(), reader.take(_F64)[0]) for _ in range(reader.count(12))))


@dataclass(frozen=True, slots=True)
class ApplicationInfo(WireObject):
    """Axis that points up; absent (old Tracker) means Z."""

    KIND: ClassVar[ObjectType] = ObjectType.APPLICATION_INFO
    y_up: bool = False

    def payload(self) -> bytes:
        """Return the encoded payload."""
        return bytes((self.y_up,))

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        return cls(PayloadReader(payload).u8() == 1)


@dataclass(frozen=True, slots=True)
class ObjectQuality(FixedObject):
    """Quality of one subject from 0 (bad) to 1 (good)."""

    KIND: ClassVar[ObjectType] = ObjectType.OBJECT_QUALITY
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<Id")
    subject: int
    quality: float


@dataclass(frozen=True, slots=True)
class Segment:
    """Pose of one segment: 100 bytes on the wire."""

    id: int
    translation_mm: Vector3 = (0.0, 0.0, 0.0)
    rotation: Matrix3 = IDENTITY


@dataclass(frozen=True, slots=True)
class GlobalSegments(WireObject):
    """One subject's segments in world coordinates; a subject without this object in a frame is occluded."""

    KIND: ClassVar[ObjectType] = ObjectType.GLOBAL_SEGMENTS
    subject: int
    segments: tuple[Segment, ...]

    def payload(self) -> bytes:
        """Return the encoded payload."""
        poses = (_SEGMENT.pack(item.id, *item.translation_mm, *item.rotation) for item in self.segments)
        return _U32.pack(self.subject) + _U32.pack(len(self.segments)) + b"".join(poses)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        subject = reader.u32()
        segments = []
        for _ in range(reader.count(_SEGMENT.size)):
            number, x, y, z, a, b, c, d, e, f, g, h, i = reader.take(_SEGMENT)
            segments.append(Segment(int(number), (x, y, z), (a, b, c, d, e, f, g, h, i)))
        return cls(subject, tuple(segments))


_OBJECTS: tuple[type[WireObject], ...] = (
    ObjectEnums, RequestFrame, RequestNextFrame, KeepAlive, Contents, Ping, Filter, GlobalSegments,
    StreamInfo, SubjectInfo, FrameInfo, LatencyInfo, ApplicationInfo, ObjectQuality,
)  # fmt: skip
_BY_KIND: dict[int, type[WireObject]] = {kind.KIND: kind for kind in _OBJECTS}


def decode_object(kind: int, payload: bytes) -> WireObject | None:
    """Decode one object; None for a type without a class here. Raises `WireError`."""
    known = _BY_KIND.get(kind)
    return None if known is None else known.parse(payload)


def decode_body(body: bytes) -> list[WireObject]:
    """Decode a packet body, other types skipped. Raises `WireError`."""
    decoded = (decode_object(kind, payload) for kind, payload in split_objects(body))
    return [item for item in decoded if item is not None]
