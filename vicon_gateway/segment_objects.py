"""Objects that carry poses and markers (Vicon DataStream SDK), in the units of the wire.

Millimetres, radians, right-handed axes, row-major rotation matrices that map segment to world coordinates.
"""

import struct
from dataclasses import dataclass
from typing import ClassVar, Self

from rcopterx.vicon_gateway.control_objects import FixedObject, ObjectType, WireObject
from rcopterx.vicon_gateway.wire import PayloadReader

Vector3 = tuple[float, float, float]
Matrix3 = tuple[float, float, float, float, float, float, float, float, float]

IDENTITY: Matrix3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

_U32_PAIR = struct.Struct("<II")
_SEGMENT = struct.Struct("<I12d")
_LIGHT_SEGMENT = struct.Struct("<I6f")


@dataclass(frozen=True, slots=True)
class Segment:
    """Pose of one segment: 100 bytes on the wire."""

    id: int
    translation_mm: Vector3 = (0.0, 0.0, 0.0)
    rotation: Matrix3 = IDENTITY


@dataclass(frozen=True, slots=True)
class _SegmentPoses(WireObject):
    """One subject's segments."""

    subject: int
    segments: tuple[Segment, ...]

    def payload(self) -> bytes:
        """Return the encoded payload."""
        poses = (_SEGMENT.pack(item.id, *item.translation_mm, *item.rotation) for item in self.segments)
        return _U32_PAIR.pack(self.subject, len(self.segments)) + b"".join(poses)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        subject = reader.u32()
        segments = []
        for _ in range(reader.count(_SEGMENT.size)):
            values = reader.take(_SEGMENT)
            segments.append(Segment(int(values[0]), _vector(values[1:4]), _matrix(values[4:13])))
        return cls(subject, tuple(segments))


@dataclass(frozen=True, slots=True)
class LocalSegments(_SegmentPoses):
    """Poses relative to the parent segment; equal to the global pose for the root."""

    KIND: ClassVar[ObjectType] = ObjectType.LOCAL_SEGMENTS


@dataclass(frozen=True, slots=True)
class GlobalSegments(_SegmentPoses):
    """Poses in world coordinates; a subject without this object in a frame is occluded."""

    KIND: ClassVar[ObjectType] = ObjectType.GLOBAL_SEGMENTS


@dataclass(frozen=True, slots=True)
class SubjectTopology(_SegmentPoses):
    """Neutral poses."""

    KIND: ClassVar[ObjectType] = ObjectType.SUBJECT_TOPOLOGY


@dataclass(frozen=True, slots=True)
class LightSegment:
    """Pose of one segment relative to its parent in single precision: 28 bytes on the wire."""

    id: int
    translation_mm: Vector3
    rotation_vector_rad: Vector3


@dataclass(frozen=True, slots=True)
class LightweightSegments(WireObject):
    """One subject's segments with rotation vectors in single precision."""

    KIND: ClassVar[ObjectType] = ObjectType.LIGHTWEIGHT_SEGMENTS
    subject: int
    segments: tuple[LightSegment, ...]

    def payload(self) -> bytes:
        """Return the encoded payload."""
        poses = (
            _LIGHT_SEGMENT.pack(item.id, *item.translation_mm, *item.rotation_vector_rad)
            for item in self.segments
        )
        return _U32_PAIR.pack(self.subject, len(self.segments)) + b"".join(poses)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        subject = reader.u32()
        segments = []
        for _ in range(reader.count(_LIGHT_SEGMENT.size)):
            values = reader.take(_LIGHT_SEGMENT)
            segments.append(LightSegment(int(values[0]), _vector(values[1:4]), _vector(values[4:7])))
        return cls(subject, tuple(segments))


@dataclass(frozen=True, slots=True)
class LabeledRecons(FixedObject):
    """Number of markers that belong to subjects; the markers after it are not decoded."""

    KIND: ClassVar[ObjectType] = ObjectType.LABELED_RECONS
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<I")
    count: int = 0


@dataclass(frozen=True, slots=True)
class UnlabeledRecons(FixedObject):
    """Number of markers that belong to no subject; the markers after it are not decoded."""

    KIND: ClassVar[ObjectType] = ObjectType.UNLABELED_RECONS
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<I")
    count: int = 0


@dataclass(frozen=True, slots=True)
class SubjectScale(FixedObject):
    """Number of segments of a subject with a scale, which are not decoded."""

    KIND: ClassVar[ObjectType] = ObjectType.SUBJECT_SCALE
    LAYOUT: ClassVar[struct.Struct] = struct.Struct("<II")
    subject: int
    count: int = 0


SEGMENT_OBJECTS: tuple[type[WireObject], ...] = (
    LabeledRecons,
    UnlabeledRecons,
    LocalSegments,
    GlobalSegments,
    LightweightSegments,
    SubjectTopology,
    SubjectScale,
)


def _vector(values: tuple[float, ...]) -> Vector3:
    x, y, z = values
    return x, y, z


def _matrix(values: tuple[float, ...]) -> Matrix3:
    a, b, c, d, e, f, g, h, i = values
    return a, b, c, d, e, f, g, h, i
