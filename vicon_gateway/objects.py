"""Objects of the DataStream protocol that a client reads or sends (Vicon DataStream SDK), in its units.

Every object is a frozen dataclass (`wire_object`) with its type number `KIND` and the layouts of its fields;
`parse` raises `WireError` and nothing else. Poses are in millimetres, right-handed, with row-major rotation
matrices that map segment to world coordinates.
"""

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Self, TypeVar, dataclass_transform

from rcopterx.vicon_gateway.wire import (
    ObjectType,
    PayloadReader,
    encode_object,
    encode_packet,
    encode_string,
    split_objects,
)

SDK_TICKS_PER_SECOND = 135_000_000  # unit of the frame period in StreamInfo

Vector3 = tuple[float, float, float]
Matrix3 = tuple[float, float, float, float, float, float, float, float, float]
IDENTITY: Matrix3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

_BY_KIND: dict[int, "type[WireObject]"] = {}


class Layout(NamedTuple):
    """How a value is written and read; a written one has at least `least_bytes`."""

    write: Callable[[Any], bytes]
    read: Callable[[PayloadReader], Any]
    least_bytes: int


def number(code: str) -> Layout:
    """A number with a code of `struct`."""
    layout = struct.Struct(f"<{code}")
    return Layout(layout.pack, lambda reader: reader.take(layout)[0], layout.size)


def numbers(code: str) -> Layout:
    """A fixed number of numbers."""
    layout = struct.Struct(f"<{code}")
    return Layout(lambda values: layout.pack(*values), lambda reader: reader.take(layout), layout.size)


def pair(first: Layout, second: Layout) -> Layout:
    """Two values."""
    return Layout(
        lambda values: first.write(values[0]) + second.write(values[1]),
        lambda reader: (first.read(reader), second.read(reader)),
        first.least_bytes + second.least_bytes,
    )


def record(kind: Callable[..., Any], fields: Mapping[str, Layout]) -> Layout:
    """An object with these fields, in the order of the wire."""
    return Layout(
        lambda item: b"".join(layout.write(getattr(item, name)) for name, layout in fields.items()),
        lambda reader: kind(**{name: layout.read(reader) for name, layout in fields.items()}),
        sum(layout.least_bytes for layout in fields.values()),
    )


def many(item: Layout) -> Layout:
    """Any number of items, after their count."""
    return Layout(
        lambda items: U32.write(len(items)) + b"".join(map(item.write, items)),
        lambda reader: tuple([item.read(reader) for _ in range(reader.count(item.least_bytes))]),
        U32.least_bytes,
    )


def mapping(key: Layout, value: Layout) -> Layout:
    """A mapping in the order of its keys."""
    entries = many(pair(key, value))
    return Layout(
        lambda items: entries.write(sorted(items.items())),
        lambda reader: dict(entries.read(reader)),
        entries.least_bytes,
    )


U32, F64 = number("I"), number("d")
STRING = Layout(encode_string, PayloadReader.string, U32.least_bytes)
U32S = many(U32)
U32_SET = Layout(
    lambda values: U32S.write(sorted(values)), lambda reader: frozenset(U32S.read(reader)), U32S.least_bytes
)
FLAG = Layout(number("?").write, lambda reader: number("B").read(reader) == 1, 1)


class WireObject:
    """Base of all objects: a type number and a payload."""

    __slots__ = ()
    KIND: ClassVar[ObjectType]
    LAYOUT: ClassVar[Layout]

    def payload(self) -> bytes:
        """Return the encoded payload."""
        return self.LAYOUT.write(self)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload, surplus bytes at its end ignored; raises `WireError`."""
        parsed: Self = cls.LAYOUT.read(PayloadReader(payload))
        return parsed

    def encode(self) -> bytes:
        """Return the object with its header."""
        return encode_object(self.KIND, self.payload())


Kind = TypeVar("Kind", bound=WireObject)


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def wire_object(kind: ObjectType, **fields: Layout) -> Callable[[type[Kind]], type[Kind]]:
    """Make a frozen dataclass of an object with a type number and the layouts of its fields."""

    def made(described: type[Kind]) -> type[Kind]:
        result = dataclass(frozen=True, slots=True)(described)
        result.KIND, result.LAYOUT = kind, record(result, fields)
        _BY_KIND[kind] = result
        return result

    return made


def packet(*objects: WireObject) -> bytes:
    """Return one packet with these objects in this order."""
    return encode_packet(*(item.encode() for item in objects))


@wire_object(ObjectType.OBJECT_ENUMS, types=U32_SET)
class ObjectEnums(WireObject):
    """The server's offer, or the client's selection out of it."""

    types: frozenset[int] = frozenset()


@wire_object(ObjectType.REQUEST_FRAME, streaming=number("?"))
class RequestFrame(WireObject):
    """Streaming: push every frame from now on; no other mode is used here."""

    streaming: bool


@wire_object(ObjectType.CONTENTS, counts=mapping(U32, U32), unchanged=U32_SET)
class Contents(WireObject):
    """Contents of a frame packet: objects per selected type, and types left out because unchanged."""

    counts: Mapping[int, int] = field(default_factory=dict)
    unchanged: frozenset[int] = frozenset()


@wire_object(ObjectType.PING, number=number("Q"))
class Ping(WireObject):
    """Echoed by the server at once, in a packet of its own."""

    number: int


@wire_object(ObjectType.STREAM_INFO, period_ticks=number("q"))
class StreamInfo(WireObject):
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


SEGMENT_INFO = record(SegmentInfo, {"parent": U32, "id": U32, "bounds_mm": numbers("6f"), "name": STRING})


@wire_object(
    ObjectType.SUBJECT_INFO,
    id=U32,
    name=STRING,
    segments=many(SEGMENT_INFO),
    markers=many(pair(U32, STRING)),
    attachments=many(pair(U32, U32)),
)
class SubjectInfo(WireObject):
    """Names and structure of one subject; `id` is the key used by all other objects."""

    id: int
    name: str
    segments: tuple[SegmentInfo, ...]
    markers: tuple[tuple[int, str], ...] = ()
    attachments: tuple[tuple[int, int], ...] = ()


@wire_object(ObjectType.FRAME_INFO, frame=U32)
class FrameInfo(WireObject):
    """Frame id counted from 0; SDK 1.11 and later report id + 1 as the frame number."""

    frame: int


@wire_object(ObjectType.LATENCY_INFO, samples=many(pair(STRING, F64)))
class LatencyInfo(WireObject):
    """Latency of each pipeline stage in seconds; the total is their sum."""

    samples: tuple[tuple[str, float], ...] = ()


@wire_object(ObjectType.APPLICATION_INFO, y_up=FLAG)
class ApplicationInfo(WireObject):
    """Axis that points up; absent (old Tracker) means Z."""

    y_up: bool = False


@wire_object(ObjectType.OBJECT_QUALITY, subject=U32, quality=F64)
class ObjectQuality(WireObject):
    """Quality of one subject from 0 (bad) to 1 (good)."""

    subject: int
    quality: float


@dataclass(frozen=True, slots=True)
class Segment:
    """Pose of one segment: 100 bytes on the wire."""

    id: int
    translation_mm: Vector3 = (0.0, 0.0, 0.0)
    rotation: Matrix3 = IDENTITY


SEGMENT = record(Segment, {"id": U32, "translation_mm": numbers("3d"), "rotation": numbers("9d")})


@wire_object(ObjectType.GLOBAL_SEGMENTS, subject=U32, segments=many(SEGMENT))
class GlobalSegments(WireObject):
    """One subject's segments in world coordinates; a subject without this object in a frame is occluded."""

    subject: int
    segments: tuple[Segment, ...]


def decode_body(body: bytes) -> list[WireObject]:
    """Decode a packet body, types without a class here skipped. Raises `WireError`."""
    return [_BY_KIND[kind].parse(payload) for kind, payload in split_objects(body) if kind in _BY_KIND]
