"""What the Tracker emulator captures, and its objects on the wire (Vicon DataStream SDK)."""

import math
import struct
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import NamedTuple

from rcopterx.vicon_gateway.control_objects import ObjectType, WireObject
from rcopterx.vicon_gateway.objects import (
    SDK_TICKS_PER_SECOND,
    ApplicationInfo,
    FrameInfo,
    FrameRateInfo,
    HardwareFrameInfo,
    LatencyInfo,
    ObjectQuality,
    SegmentInfo,
    StreamInfo,
    SubjectHealth,
    SubjectInfo,
    Timecode,
)
from rcopterx.vicon_gateway.rotations import matrix_from_quaternion, y_up_from_z_up
from rcopterx.vicon_gateway.segment_objects import (
    LabeledRecons,
    LightSegment,
    LightweightSegments,
    Segment,
    SubjectScale,
    SubjectTopology,
    UnlabeledRecons,
)
from rcopterx.vicon_gateway.wire import HEADER

_TRACKER1 = frozenset({100004, 1, 2, 5, 6, 7, 8, 9, 23, 26, 28, 29})
_TRACKER2 = _TRACKER1 | {36, 37, 39}
_TRACKER3 = _TRACKER2 | {40, 42, 901, 28001}

PROFILES: Mapping[str, frozenset[int]] = {"tracker1": _TRACKER1, "tracker2": _TRACKER2, "tracker3": _TRACKER3}
"""Offered object types by age of the Tracker (section 8)."""

ROOT_SEGMENT = 1
_POSES = frozenset({8, 9, 901})
_ONE_SEGMENT = struct.Struct("<5I12d")
"""A whole object: header, subject, number of segments, segment, translation, rotation."""
_Encoded = tuple[tuple[int, ...] | None, list[bytes]]
"""Objects of a type, and whose they are where they belong to subjects."""
_CONSTANT_PER_SUBJECT = frozenset({2, 28, 29, 28001})
_CONSTANT: Mapping[int, Callable[[float, bool], WireObject]] = {
    ObjectType.STREAM_INFO: lambda rate_hz, _: StreamInfo(round(SDK_TICKS_PER_SECOND / rate_hz)),
    ObjectType.TIMECODE: lambda *_: Timecode(),
    ObjectType.APPLICATION_INFO: lambda _, y_up: ApplicationInfo(y_up),
    ObjectType.FRAME_RATE_INFO: lambda rate_hz, _: FrameRateInfo({"Hardware": rate_hz, "System": rate_hz}),
    ObjectType.LABELED_RECONS: lambda *_: LabeledRecons(),
    ObjectType.UNLABELED_RECONS: lambda *_: UnlabeledRecons(),
}
"""Objects of the whole stream that do not depend on the frame, from its rate and whether y is up."""
_NUMBERED: Mapping[int, Callable[[int], WireObject]] = {
    ObjectType.FRAME_INFO: FrameInfo,
    ObjectType.HARDWARE_FRAME_INFO: HardwareFrameInfo,
}
"""Objects of the whole stream that carry the frame's number."""


class TrackedBody(NamedTuple):
    """One subject at the capture instant.

    Attributes
    ----------
    position_m
        In the world, Z up.
    quaternion_xyzw
        Unit quaternion, body to world.
    quality
        From 0 to 1.
    occluded
        Listed, but not seen.
    root_segment
        Name of the root segment where it differs from the subject's.
    """

    name: str
    position_m: tuple[float, float, float]
    quaternion_xyzw: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    quality: float = 1.0
    occluded: bool = False
    root_segment: str | None = None


class TrackerFrame(NamedTuple):
    """One captured frame: its id from 0, every listed subject, and latencies until publishing."""

    frame: int
    bodies: tuple[TrackedBody, ...]
    latency_samples: tuple[tuple[str, float], ...] = (("System", 0.0),)


class FrameContent:
    """The encoded objects of one frame, each type encoded once and only when a client selects it."""

    def __init__(
        self, frame: TrackerFrame, rate_hz: float, subject_ids: Mapping[str, int], y_up: bool = False
    ) -> None:
        self.frame = frame
        self._rate_hz = rate_hz
        self._bodies = [(subject_ids[body.name], body) for body in frame.bodies]
        self._y_up = y_up
        self._encoded: dict[int, _Encoded] = {}

    def objects(self, kind: int, allowed: frozenset[int] | None = None) -> list[bytes]:
        """Return the encoded objects of a type, restricted to these subject ids where a filter names them."""
        encoded = self._encoded.get(kind)
        if encoded is None:
            encoded = self._encoded[kind] = self._encode(kind)
        subjects, data = encoded
        if allowed is None or subjects is None:
            return data
        return [item for subject, item in zip(subjects, data, strict=True) if subject in allowed]

    def _encode(self, kind: int) -> _Encoded:
        if kind in _CONSTANT:
            return None, _constant_single(kind, self._rate_hz, self._y_up)
        if kind == ObjectType.LATENCY_INFO:
            return None, _latency(self.frame.latency_samples)
        if kind in _NUMBERED:
            return None, [_NUMBERED[kind](self.frame.frame).encode()]
        bodies = self._bodies
        if kind == ObjectType.OBJECT_QUALITY:
            return _qualities(tuple([(subject, body.quality) for subject, body in bodies]))
        if kind in _CONSTANT_PER_SUBJECT:
            names = [(subject, body.name, body.root_segment or body.name) for subject, body in bodies]
            return _constant_objects(kind, tuple(names))
        seen = [(subject, body) for subject, body in bodies if not body.occluded and kind in _POSES]
        return tuple([subject for subject, _ in seen]), self._poses(kind, seen)

    def _poses(self, kind: int, seen: list[tuple[int, TrackedBody]]) -> list[bytes]:
        if kind in (ObjectType.GLOBAL_SEGMENTS, ObjectType.LOCAL_SEGMENTS):
            # Of one segment each, which is the root: both say the same.
            return [
                _ONE_SEGMENT.pack(
                    kind, _ONE_SEGMENT.size - HEADER.size, subject, 1, ROOT_SEGMENT, *self._numbers(body)
                )
                for subject, body in seen
            ]
        return [LightweightSegments(subject, (self._light_segment(body),)).encode() for subject, body in seen]

    def _pose(
        self, body: TrackedBody
    ) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
        x, y, z = body.position_m
        translation_mm = (x * 1000.0, y * 1000.0, z * 1000.0)
        if not self._y_up:
            return translation_mm, body.quaternion_xyzw
        vector, w = body.quaternion_xyzw[:3], body.quaternion_xyzw[3]
        return y_up_from_z_up(translation_mm), (*y_up_from_z_up(vector), w)

    def _numbers(self, body: TrackedBody) -> tuple[float, ...]:
        """Translation and rotation of the root segment, twelve numbers."""
        translation_mm, quaternion = self._pose(body)
        return *translation_mm, *matrix_from_quaternion(quaternion)

    def _light_segment(self, body: TrackedBody) -> LightSegment:
        translation_mm, (x, y, z, w) = self._pose(body)
        sine = math.sqrt(x * x + y * y + z * z)
        # Near identity the angle over the sine of its half tends to two.
        factor = 2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
        return LightSegment(ROOT_SEGMENT, translation_mm, (x * factor, y * factor, z * factor))


# Lists of the frame before compare equal without a comparison of their bytes.
@lru_cache(maxsize=64)
def _constant_single(kind: int, rate_hz: float, y_up: bool) -> list[bytes]:
    """Return an object of the whole stream that does not depend on the frame, encoded."""
    return [_CONSTANT[kind](rate_hz, y_up).encode()]


@lru_cache(maxsize=8)
def _latency(samples: tuple[tuple[str, float], ...]) -> list[bytes]:
    return [LatencyInfo(samples).encode()]


@lru_cache(maxsize=8)
def _qualities(of_subjects: tuple[tuple[int, float], ...]) -> _Encoded:
    subjects = tuple([subject for subject, _ in of_subjects])
    return subjects, [ObjectQuality(subject, quality).encode() for subject, quality in of_subjects]


@lru_cache(maxsize=32)
def _constant_objects(kind: int, subjects: tuple[tuple[int, str, str], ...]) -> _Encoded:
    """Return objects that do not depend on the frame, of subjects with their names and root segments."""
    data = [_constant_object(kind, subject, name, root_segment) for subject, name, root_segment in subjects]
    return tuple([subject for subject, _, _ in subjects]), data


def _constant_object(kind: int, subject: int, name: str, root_segment: str) -> bytes:
    match kind:
        case ObjectType.SUBJECT_INFO:
            return SubjectInfo(subject, name, (SegmentInfo(0, ROOT_SEGMENT, root_segment),)).encode()
        case ObjectType.SUBJECT_TOPOLOGY:
            return SubjectTopology(subject, (Segment(ROOT_SEGMENT),)).encode()
        case ObjectType.SUBJECT_SCALE:
            return SubjectScale(subject).encode()
        case _:
            return SubjectHealth(subject, marker_error_mm=0.2, health=1.0).encode()
