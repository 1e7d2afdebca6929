"""Data objects of the DataStream protocol (Vicon DataStream SDK), and decoding by type number.

Objects with poses are in `segment_objects`. Units are those of the wire; conversion to metres and quaternions
is `datastream`'s work.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Self

from rcopterx.vicon_gateway.control_objects import CONTROL_OBJECTS, FixedObject, ObjectType, WireObject
from rcopterx.vicon_gateway.segment_objects import SEGMENT_OBJECTS
from rcopterx.vicon_gateway.wire import PayloadReader, encode_string, split_objects

SDK_TICKS_PER_SECOND = 135_000_000
"""Unit of the frame period in StreamInfo."""

_U32 = struct.Struct("<I")
_F64 = struct.Struct("<d")
_BOUNDS = struct.Struct("<6f")


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
class Timecode(FixedObject):
    """Video time code; `standard` 0xFFFFFFFF means none."""

    KIND: ClassVar[ObjectType] = ObjectType.TIMECODE
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<4B2H2IB")
    hours: int = 0
    minutes: int = 0
    seconds: int = 0
    frames: int = 0
    subframe: int = 0
    subframes_per_frame: int = 0
    standard: int = 0xFFFFFFFF
    user_bits: int = 0
    field_flag: int = 0


@dataclass(frozen=True, slots=True)
class LatencyInfo(WireObject):
    """Latency of each pipeline stage in seconds; the total is their sum."""

    KIND: ClassVar[ObjectType] = ObjectType.LATENCY_INFO
    samples: tuple[tuple[str, float], ...] = ()

    def payload(self) -> bytes:
        """Return the encoded payload."""
        return _U32.pack(len(self.samples)) + b"".join(
            _named_value(name, value) for name, value in self.samples
        )

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        return cls(tuple((reader.string(), reader.take(_F64)[0]) for _ in range(reader.count(12))))


@dataclass(frozen=True, slots=True)
class SubjectHealth(FixedObject):
    """Marker error in millimetres and health from 0 to 1."""

    KIND: ClassVar[ObjectType] = ObjectType.SUBJECT_HEALTH
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<Idd")
    subject: int
    marker_error_mm: float
    health: float


@dataclass(frozen=True, slots=True)
class HardwareFrameInfo(FixedObject):
    """Camera frame counter."""

    KIND: ClassVar[ObjectType] = ObjectType.HARDWARE_FRAME_INFO
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<I")
    counter: int


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
class FrameRateInfo(WireObject):
    """Named frame rates in hertz, informative."""

    KIND: ClassVar[ObjectType] = ObjectType.FRAME_RATE_INFO
    rates_hz: Mapping[str, float] = field(default_factory=dict)

    def payload(self) -> bytes:
        """Return the encoded payload."""
        entries = (_named_value(name, self.rates_hz[name]) for name in sorted(self.rates_hz))
        return _U32.pack(len(self.rates_hz)) + b"".join(entries)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        return cls({reader.string(): reader.take(_F64)[0] for _ in range(reader.count(12))})


@dataclass(frozen=True, slots=True)
class ObjectQuality(FixedObject):
    """Quality of one subject from 0 (bad) to 1 (good)."""

    KIND: ClassVar[ObjectType] = ObjectType.OBJECT_QUALITY
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<Id")
    subject: int
    quality: float


DATA_OBJECTS: tuple[type[WireObject], ...] = (
    *SEGMENT_OBJECTS,
    StreamInfo,
    SubjectInfo,
    FrameInfo,
    Timecode,
    LatencyInfo,
    SubjectHealth,
    HardwareFrameInfo,
    ApplicationInfo,
    FrameRateInfo,
    ObjectQuality,
)

_BY_KIND: dict[int, type[WireObject]] = {int(item.KIND): item for item in (*CONTROL_OBJECTS, *DATA_OBJECTS)}


def decode_object(kind: int, payload: bytes) -> WireObject | None:
    """Decode one object; None for a type this package does not know. Raises `WireError`."""
    known = _BY_KIND.get(kind)
    return None if known is None else known.parse(payload)


def decode_body(body: bytes) -> list[WireObject]:
    """Decode a packet body, unknown types skipped. Raises `WireError`."""
    decoded = (decode_object(kind, payload) for kind, payload in split_objects(body))
    return [item for item in decoded if item is not None]


def _named_value(name: str, value: float) -> bytes:
    return encode_string(name) + _F64.pack(value)
