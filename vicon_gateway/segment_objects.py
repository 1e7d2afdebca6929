"""Objects that carry poses and markers (Vicon DataStream SDK), in the units of the wire.

Millimetres, radians, right-handed axes, row-major rotation matrices that map segment to world coordinates.
"""

import struct
from dataclasses import dataclass
from typing import ClassVar, Self

from rcopterx.vicon_gateway.control_objects import ObjectType, WireObject
from rcopterx.vicon_gateway.wire import PayloadReader

Vector3 = tuple[float, float, float]
Matrix3 = tuple[float, float, float, float, float, float, float, float, float]

IDENTITY: Matrix3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

_U32 = struct.Struct("<I")
_U32_PAIR = struct.Struct("<II")
_SEGMENT = struct.Struct("<I12d")
_LIGHT_SEGMENT = struct.Struct("<I6f")
_SCALE = struct.Struct("<I3d")
_RECON = struct.Struct("<d12dI")


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
class Recon:
    """One reconstructed marker; `subject` and `marker` only where it is labelled."""

    position_mm: Vector3
    radius_mm: float = 0.0
    covariance: Matrix3 = (0.0,) * 9
    trajectory: int = 0
    subject: int = 0
    marker: int = 0

    def common(self) -> bytes:
        """Return the fields labelled and unlabelled markers share."""
        return _RECON.pack(self.radius_mm, *self.position_mm, *self.covariance, self.trajectory)

    @classmethod
    def read(cls, reader: PayloadReader, subject: int = 0, marker: int = 0) -> Self:
        """Read the shared fields."""
        values = reader.take(_RECON)
        return cls(_vector(values[1:4]), values[0], _matrix(values[4:13]), int(values[13]), subject, marker)


@dataclass(frozen=True, slots=True)
class LabeledRecons(WireObject):
    """Markers that belong to subjects."""

    KIND: ClassVar[ObjectType] = ObjectType.LABELED_RECONS
    recons: tuple[Recon, ...] = ()

    def payload(self) -> bytes:
        """Return the encoded payload."""
        entries = (_U32_PAIR.pack(item.subject, item.marker) + item.common() for item in self.recons)
        return _U32.pack(len(self.recons)) + b"".join(entries)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        number = reader.count(8 + _RECON.size)
        return cls(tuple(Recon.read(reader, reader.u32(), reader.u32()) for _ in range(number)))


@dataclass(frozen=True, slots=True)
class UnlabeledRecons(WireObject):
    """Markers that belong to no subject."""

    KIND: ClassVar[ObjectType] = ObjectType.UNLABELED_RECONS
    recons: tuple[Recon, ...] = ()

    def payload(self) -> bytes:
        """Return the encoded payload."""
        return _U32.pack(len(self.recons)) + b"".join(item.common() for item in self.recons)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        return cls(tuple(Recon.read(reader) for _ in range(reader.count(_RECON.size))))


@dataclass(frozen=True, slots=True)
class SubjectScale(WireObject):
    """Scale per segment; an empty one is fine."""

    KIND: ClassVar[ObjectType] = ObjectType.SUBJECT_SCALE
    subject: int
    scales: tuple[tuple[int, Vector3], ...] = ()

    def payload(self) -> bytes:
        """Return the encoded payload."""
        entries = (_SCALE.pack(segment, *scale) for segment, scale in self.scales)
        return _U32_PAIR.pack(self.subject, len(self.scales)) + b"".join(entries)

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Decode a payload; raises `WireError`."""
        reader = PayloadReader(payload)
        subject = reader.u32()
        entries = [reader.take(_SCALE) for _ in range(reader.count(_SCALE.size))]
        return cls(subject, tuple((int(entry[0]), _vector(entry[1:4])) for entry in entries))


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
