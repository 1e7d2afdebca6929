"""Captured frames of the Tracker emulator, and their objects on the wire (Vicon DataStream SDK)."""

import struct
from collections.abc import Mapping
from typing import NamedTuple

from rcopterx.vehicles.tuples import Four, Three
from rcopterx.vicon_gateway import objects as sdk
from rcopterx.vicon_gateway.rotations import matrix_from_quaternion, y_up_from_z_up
from rcopterx.vicon_gateway.wire import ObjectType, encode_object

_TRACKER1 = frozenset({100004, 1, 2, 5, 7, 8, 9, 23, 26, 28, 29})
_TRACKER2 = _TRACKER1 | {37, 39}
_TRACKER3 = _TRACKER2 | {40, 42, 28001}

PROFILES: Mapping[str, frozenset[int]] = {"tracker1": _TRACKER1, "tracker2": _TRACKER2, "tracker3": _TRACKER3}
"""Offered object types by age of the Tracker."""

ROOT_SEGMENT = 1
_POSES = frozenset({ObjectType.LOCAL_SEGMENTS, ObjectType.GLOBAL_SEGMENTS})
_NO_TIMECODE = struct.pack("<4B2H2IB", 0, 0, 0, 0, 0, 0, 0xFFFFFFFF, 0, 0)
_NO_MARKERS = bytes(4)
_SCALE = struct.Struct("<II")  # subject, number of its segments with a scale
_HEALTH = struct.Struct("<Idd")  # subject, marker error [mm], health from 0 to 1


class TrackedBody(NamedTuple):
    """A subject at the capture instant: pose in the world, Z up, quality 0 to 1; occluded: listed, unseen."""

    name: str
    position_m: Three
    quaternion_xyzw: Four = (0.0, 0.0, 0.0, 1.0)
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
        self._encoded: dict[int, list[bytes]] = {}

    def objects(self, kind: int) -> list[bytes]:
        """Return the encoded objects of a type."""
        if (encoded := self._encoded.get(kind)) is None:
            encoded = self._encoded[kind] = [encode_object(kind, payload) for payload in self._payloads(kind)]
        return encoded

    def _payloads(self, kind: int) -> list[bytes]:
        if (payload := self._payload_of_stream(kind)) is not None:
            return [payload]
        bodies = (entry for entry in self._bodies if kind not in _POSES or not entry[1].occluded)
        return [self._payload_of_subject(kind, subject, body) for subject, body in bodies]

    def _payload_of_stream(self, kind: int) -> bytes | None:
        """Payload of an object of the whole stream; None for a type that belongs to subjects."""
        match kind:
            case ObjectType.STREAM_INFO:
                return sdk.StreamInfo(round(sdk.SDK_TICKS_PER_SECOND / self._rate_hz)).payload()
            case ObjectType.FRAME_INFO:
                return sdk.FrameInfo(self.frame.frame).payload()
            case ObjectType.LATENCY_INFO:
                return sdk.LatencyInfo(self.frame.latency_samples).payload()
            case ObjectType.TIMECODE:
                return _NO_TIMECODE
            case ObjectType.APPLICATION_INFO:
                return sdk.ApplicationInfo(self._y_up).payload()
            case ObjectType.FRAME_RATE_INFO:
                # Named numbers, as in LatencyInfo.
                return sdk.LatencyInfo((("Hardware", self._rate_hz), ("System", self._rate_hz))).payload()
            case ObjectType.UNLABELED_RECONS:
                return _NO_MARKERS
            case _:
                return None

    def _payload_of_subject(self, kind: int, subject: int, body: TrackedBody) -> bytes:
        match kind:
            case ObjectType.GLOBAL_SEGMENTS | ObjectType.LOCAL_SEGMENTS:
                translation_mm, quaternion = self._pose(body)
                root = sdk.Segment(ROOT_SEGMENT, translation_mm, matrix_from_quaternion(quaternion))
                return sdk.GlobalSegments(subject, (root,)).payload()
            case ObjectType.OBJECT_QUALITY:
                return sdk.ObjectQuality(subject, body.quality).payload()
            case ObjectType.SUBJECT_INFO:
                name = body.root_segment or body.name
                return sdk.SubjectInfo(
                    subject, body.name, (sdk.SegmentInfo(0, ROOT_SEGMENT, name),)
                ).payload()
            case ObjectType.SUBJECT_TOPOLOGY:
                return sdk.GlobalSegments(subject, (sdk.Segment(ROOT_SEGMENT),)).payload()
            case ObjectType.SUBJECT_SCALE:
                return _SCALE.pack(subject, 0)
            case _:
                return _HEALTH.pack(subject, 0.2, 1.0)

    def _pose(self, body: TrackedBody) -> tuple[Three, Four]:
        x, y, z = body.position_m
        translation_mm = (x * 1000.0, y * 1000.0, z * 1000.0)
        if not self._y_up:
            return translation_mm, body.quaternion_xyzw
        vector, w = body.quaternion_xyzw[:3], body.quaternion_xyzw[3]
        return y_up_from_z_up(translation_mm), (*y_up_from_z_up(vector), w)
