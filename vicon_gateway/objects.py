"""Objects of the DataStream protocol that a client reads or sends (Vicon DataStream SDK), in its units.

Every object is a frozen dataclass (`wire_object`) with its type number `KIND`, `payload()` to encode and
`parse(payload)` to decode; `parse` raises `WireError` and nothing else. Poses are in millimetres,
right-handed, with row-major rotation matrices that map segment to world coordinates.
"""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Self, TypeVar, dataclass_transform

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
_BY_KIND: dict[int, "type[WireObject]"] = {}


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


Kind = TypeVar("Kind", bound=WireObject)


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def wire_object(kind: ObjectType, layout: str = "") -> Callable[[type[Kind]], type[Kind]]:
    """Make a frozen dataclass of an object with a type number, and a fixed layout if it has one."""

    def made(described: type[Kind]) -> type[Kind]:
        result = dataclass(frozen=True, slots=True)(described)
        result.KIND = kind
        if issubclass(result, FixedObject):
            result.LAYOUT = struct.Struct(layout)
        _BY_KIND[kind] = result
        return result

    return made


def packet(*objects: WireObject) -> bytes:
    """Return one packet with these objects in this order."""
    return encode_packet(*(item.encode() for item in objects))


@wire_object(ObjectType.OBJECT_ENUMS)
class ObjectEnums(WireObject):
    """The server's offer, or the client's selection out of it."""

    types: frozenset[int] = frozenset()

    def payload(self) -> bytes:
        """Return the encoded payload."""
        return encode_u32_set(self.types)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        return cls(frozenset(PayloadReader(payload).u32_list()))


@wire_object(ObjectType.REQUEST_FRAME, "<?")
class RequestFrame(FixedObject):
    """Streaming: push every frame from now on. Otherwise: stop pushing and send one frame."""

    streaming: bool


@wire_object(ObjectType.REQUEST_NEXT_FRAME, "<I")
class RequestNextFrame(FixedObject):
    """Ask for the next `number` frames, each as soon as it is captured (SDK 1.9 and later)."""

    number: int = 1


@wire_object(ObjectType.KEEP_ALIVE)
class KeepAlive(WireObject):
    """No content; clients ignore it."""


@wire_object(ObjectType.CONTENTS)
class Contents(WireObject):
    """Contents of a frame packet: objects per selected type, and types left out because unchanged."""

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


@wire_object(ObjectType.PING, "<Q")
class Ping(FixedObject):
    """Echoed by the server at once, in a packet of its own."""

    number: int


@wire_object(ObjectType.FILTER)
class Filter(WireObject):
    """For the named types send only objects of these subject (or camera) ids."""

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


@wire_object(ObjectType.STREAM_INFO, "<q")
class StreamInfo(FixedObject):
    """Frame period in ticks of 135 MHz."""

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


@wire_object(ObjectType.SUBJECT_INFO)
class SubjectInfo(WireObject):
    """Names and structure of one subject; `id` is the key used by all other objects."""

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


@wire_object(ObjectType.FRAME_INFO, "<I")
class FrameInfo(FixedObject):
    """Frame id counted from 0; SDK 1.11 and later report id + 1 as the frame number."""

    frame: int


@wire_object(ObjectType.LATENCY_INFO)
class LatencyInfo(WireObject):
    """Latency of each pipeline stage in seconds; the total is their sum."""

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


@wire_object(ObjectType.APPLICATION_INFO)
class ApplicationInfo(WireObject):
    """Axis that points up; absent (old Tracker) means Z."""

    y_up: bool = False

    def payload(self) -> bytes:
        """Return the encoded payload."""
        return bytes((self.y_up,))

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        return cls(PayloadReader(payload).u8() == 1)


@wire_object(ObjectType.OBJECT_QUALITY, "<Id")
class ObjectQuality(FixedObject):
    """Quality of one subject from 0 (bad) to 1 (good)."""

    subject: int
    quality: float


@dataclass(frozen=True, slots=True)
class Segment:
    """Pose of one segment: 100 bytes on the wire."""

    id: int
    translation_mm: Vector3 = (0.0, 0.0, 0.0)
    rotation: Matrix3 = IDENTITY


@wire_object(ObjectType.GLOBAL_SEGMENTS)
class GlobalSegments(WireObject):
    """One subject's segments in world coordinates; a subject without this object in a frame is occluded."""

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


def decode_object(kind: int, payload: bytes) -> WireObject | None:
    """Decode one object; None for a type without a class here. Raises `WireError`."""
    known = _BY_KIND.get(kind)
    return None if known is None else known.parse(payload)


def decode_body(body: bytes) -> list[WireObject]:
    """Decode a packet body, other types skipped. Raises `WireError`."""
    decoded = (decode_object(kind, payload) for kind, payload in split_objects(body))
    return [item for item in decoded if item is not None]
