"""The client's side of a DataStream connection as a pure state machine (Vicon DataStream SDK).

Bytes and the time of their arrival go in, frames and bytes to send come out. No socket, no clock.
"""

from collections import deque
from collections.abc import Callable, Iterable
from typing import Final

from msgspec import Struct

from rcopterx.vicon_gateway import objects as sdk
from rcopterx.vicon_gateway.frame import CapturedFrame, SubjectPose
from rcopterx.vicon_gateway.rotations import root_pose
from rcopterx.vicon_gateway.wire import (
    DYNAMIC_TYPES,
    STATIC_TYPES,
    ObjectType,
    PacketReader,
    WireError,
    split_objects,
)

_NOTHING: frozenset[int] = frozenset()


class CarryOver:
    """Applies packets to the two classes of objects, each with its own rule.

    Static objects stay until a packet carries any static object; then the types named as unchanged are kept
    and all others become empty. Dynamic objects are rebuilt by every packet that carries one; types named as
    unchanged are copied from the previous frame. Types are carried over as a whole. `payloads` are the
    objects that are valid now, `contents` that of the last packet.
    """

    def __init__(self) -> None:
        self.payloads: dict[int, list[bytes]] = {}
        self.contents: sdk.Contents | None = None

    def apply(self, objects: Iterable[tuple[int, bytes]]) -> bool:
        """Apply a packet's objects; True for a frame, with a dynamic object. Raises `WireError`."""
        present: dict[int, list[bytes]] = {}
        for kind, payload in objects:
            present.setdefault(kind, []).append(payload)
        unchanged = self._unchanged(present.pop(ObjectType.CONTENTS, None))
        is_frame = not DYNAMIC_TYPES.isdisjoint(present)
        kept = self.payloads
        if is_frame:
            kept = {kind: was for kind, was in kept.items() if kind in unchanged or kind in STATIC_TYPES}
        if not STATIC_TYPES.isdisjoint(present):
            kept = {kind: was for kind, was in kept.items() if kind in unchanged or kind in DYNAMIC_TYPES}
        known = {kind: new for kind, new in present.items() if kind in STATIC_TYPES or kind in DYNAMIC_TYPES}
        self.payloads = {**kept, **known}
        return is_frame

    def _unchanged(self, payloads: list[bytes] | None) -> frozenset[int]:
        if payloads is None:
            self.contents = None
            return _NOTHING
        self.contents = sdk.Contents.parse(payloads[0])
        return self.contents.unchanged


REQUIRED_TYPES = {
    ObjectType.STREAM_INFO: "the frame period",
    ObjectType.SUBJECT_INFO: "the subjects",
    ObjectType.FRAME_INFO: "the frame id",
    ObjectType.GLOBAL_SEGMENTS: "the poses",
}
"""Without these no pose can be delivered."""

WANTED_TYPES = frozenset(REQUIRED_TYPES) | {
    ObjectType.LATENCY_INFO,
    ObjectType.APPLICATION_INFO,
    ObjectType.FRAME_RATE_INFO,
    ObjectType.OBJECT_QUALITY,
    ObjectType.CONTENTS,
}

PING_PERIOD_S = 1.0
FEWEST_PINGS = 3  # answered ones, of which one has not waited for a processor
MAX_LATENCY_S = 10.0
MAX_PERIOD_S = 10.0
_NO_FRAME_ID = 0xFFFFFFFF

_CARRIED = STATIC_TYPES | DYNAMIC_TYPES | {ObjectType.CONTENTS}


class StreamCounters(Struct):
    """Counters of frames; one object outlives the sessions of a client."""

    frames: int = 0
    skipped: int = 0  # received, but a newer one arrived before the caller's next call
    lost: int = 0  # missing frame ids within a connection
    repeated: int = 0  # frames with the id of the frame before; not delivered
    restarts: int = 0
    rejected: int = 0  # malformed packets, and values refused: not finite, out of range, not a rotation


class DataStreamSession:
    """One connection to a DataStream server, number `connection`; `counters` outlive it."""

    def __init__(self, connection: int = 1, counters: StreamCounters | None = None) -> None:
        self.counters = StreamCounters() if counters is None else counters
        self.offer: frozenset[int] | None = None
        self.period_s: float | None = None
        self._connection = connection
        self._reader = PacketReader()
        self._carry_over = CarryOver()
        self._outgoing = b""
        self._segments_selected = False
        self._last_frame: int | None = None
        self._pending: tuple[int, float] | None = None
        self._decoded: dict[int, list[bytes]] = {}
        self._subjects: list[tuple[int, str, int | None]] = []  # id, name and id of the root segment
        self._segments: dict[int, tuple[sdk.Segment, ...]] = {}
        self._qualities: dict[int, float] = {}
        self._latency_s = 0.0  # without that of the network
        self._y_up = False
        self._ping_number = 0
        self._ping_sent_s: float | None = None
        self._ping_due_s = float("-inf")
        self._round_trips_s: deque[float] = deque(maxlen=20)

    @property
    def network_latency_s(self) -> float | None:
        """Half of the shortest round trip of the last 20 pings: others waited for a processor, too."""
        known = len(self._round_trips_s) >= FEWEST_PINGS
        return min(self._round_trips_s) / 2.0 if known else None

    def take_outgoing(self) -> bytes:
        """Return the bytes to send now, and forget them."""
        data, self._outgoing = self._outgoing, b""
        return data

    def feed(self, data: bytes, now_s: float) -> None:
        """Process received bytes; frames wait for `take_frame`.

        A `WireError` ends the session: a packet left out would break the carry-over of the following ones.
        """
        self._reader.feed(data)
        while (body := self._next_body()) is not None:
            self._accept(body, now_s)

    def take_frame(self) -> CapturedFrame | None:
        """Return the newest frame not delivered yet; older ones have been counted as skipped."""
        if self._pending is None or self.period_s is None:
            return None
        frame, received_s = self._pending
        self._pending = None
        self.counters.frames += 1
        latency_s = self._latency_s + (self.network_latency_s or 0.0)
        subjects = tuple([self._subject_pose(*subject) for subject in self._subjects])
        return CapturedFrame(frame, self._connection, self.period_s, received_s, latency_s, subjects)

    def _next_body(self) -> bytes | None:
        try:
            return self._reader.next_body()
        except WireError as error:
            if self.offer is None:
                raise WireError(f"not a DataStream server: {error}") from error
            raise

    def _accept(self, body: bytes, now_s: float) -> None:
        objects = split_objects(body)
        for kind, payload in objects:
            if kind == ObjectType.OBJECT_ENUMS:
                self._select(sdk.ObjectEnums.parse(payload).types)
            elif kind == ObjectType.PING:
                self._answered(sdk.Ping.parse(payload).number, now_s)
        if self.offer is None:
            raise WireError("not a DataStream server: the first packet holds no offer")
        if _CARRIED.isdisjoint([kind for kind, _ in objects]):
            return  # an answered ping, for instance, changes nothing about what is valid
        if self._carry_over.apply(objects):
            self._update(now_s)

    def _select(self, offer: frozenset[int]) -> None:
        missing = [f"{what} (type {kind:d})" for kind, what in REQUIRED_TYPES.items() if kind not in offer]
        if missing:
            raise WireError(f"the server does not offer {', '.join(missing)}")
        self.offer = offer
        self._outgoing += sdk.packet(sdk.ObjectEnums(WANTED_TYPES & offer), sdk.RequestFrame(streaming=True))

    def _update(self, now_s: float) -> None:
        """Decode a frame; malformed objects show here even in frames that are skipped."""
        for kind, decode in _DECODERS.items():
            payloads = self._carry_over.payloads.get(kind, [])
            # Most objects are the same in nearly every frame.
            if payloads != self._decoded.get(kind):
                decode(self, payloads)
                self._decoded[kind] = payloads
        self._segments_selected = self._segments_selected or self._carries_segments()
        if self._segments_selected:
            self._update_frame(self._carry_over.payloads.get(ObjectType.FRAME_INFO), now_s)
            self._ping(now_s)

    def _carries_segments(self) -> bool:
        """Whether a frame follows our selection; earlier ones show every subject as occluded."""
        contents = self._carry_over.contents
        if contents is None or self._segments:
            return True
        return ObjectType.GLOBAL_SEGMENTS in contents.counts.keys() | contents.unchanged

    def _update_period(self, payloads: list[bytes]) -> None:
        if not payloads:
            return  # a period once known stays known, even where the carry-over rule drops the object
        period_s = sdk.StreamInfo.parse(payloads[0]).period_s
        if 0.0 < period_s <= MAX_PERIOD_S:
            self.period_s = period_s
        else:
            self.counters.rejected += 1

    def _update_subjects(self, payloads: list[bytes]) -> None:
        self._subjects = []
        for info in map(sdk.SubjectInfo.parse, payloads):
            # The root segment is the one whose parent is 0, whatever its name.
            roots = (segment.id for segment in info.segments if segment.parent == 0)
            self._subjects.append((info.id, info.name, next(roots, None)))

    def _update_axes(self, payloads: list[bytes]) -> None:
        self._y_up = bool(payloads) and sdk.ApplicationInfo.parse(payloads[0]).y_up

    def _update_latency(self, payloads: list[bytes]) -> None:
        samples = sdk.LatencyInfo.parse(payloads[0]).samples if payloads else ()
        plausible_s = [latency_s for _, latency_s in samples if 0.0 <= latency_s <= MAX_LATENCY_S]
        self._latency_s = sum(plausible_s)
        self.counters.rejected += len(samples) - len(plausible_s)

    def _update_qualities(self, payloads: list[bytes]) -> None:
        self._qualities = {}
        for rated in map(sdk.ObjectQuality.parse, payloads):
            if 0.0 <= rated.quality <= 1.0:
                self._qualities[rated.subject] = rated.quality
            else:
                self.counters.rejected += 1

    def _update_segments(self, payloads: list[bytes]) -> None:
        self._segments = {poses.subject: poses.segments for poses in map(sdk.GlobalSegments.parse, payloads)}

    def _update_frame(self, payloads: list[bytes] | None, now_s: float) -> None:
        frame = sdk.FrameInfo.parse(payloads[0]).frame if payloads else _NO_FRAME_ID
        if frame == _NO_FRAME_ID or self.period_s is None:
            self.counters.rejected += 1
            return
        if self._last_frame is not None:
            missing = frame - self._last_frame - 1
            if missing == -1:
                self.counters.repeated += 1
                return
            if missing < -1:
                self.counters.restarts += 1
            else:
                self.counters.lost += missing
        if self._pending is not None:
            self.counters.skipped += 1
        self._last_frame = frame
        self._pending = (frame, now_s)

    def _subject_pose(self, number: int, name: str, root_segment: int | None) -> SubjectPose:
        """Pose of a subject; it is occluded without a root segment, or with one that has no pose."""
        quality = self._qualities.get(number)
        for segment in self._segments.get(number, ()):
            if segment.id == root_segment:
                pose = root_pose(segment, self._y_up)
                if pose is not None:
                    return SubjectPose(name, False, *pose, quality)
                self.counters.rejected += 1
                break
        return SubjectPose(name, True, None, None, quality)

    def _ping(self, now_s: float) -> None:
        if self.offer is None or ObjectType.PING not in self.offer or now_s < self._ping_due_s:
            return
        self._ping_number += 1
        self._ping_sent_s, self._ping_due_s = now_s, now_s + PING_PERIOD_S
        self._outgoing += sdk.packet(sdk.Ping(self._ping_number))

    def _answered(self, number: int, now_s: float) -> None:
        if self._ping_sent_s is not None and number == self._ping_number:
            self._round_trips_s.append(max(0.0, now_s - self._ping_sent_s))
            self._ping_sent_s = None


_DECODERS: Final[dict[int, Callable[[DataStreamSession, list[bytes]], None]]] = {
    ObjectType.STREAM_INFO: DataStreamSession._update_period,
    ObjectType.SUBJECT_INFO: DataStreamSession._update_subjects,
    ObjectType.APPLICATION_INFO: DataStreamSession._update_axes,
    ObjectType.LATENCY_INFO: DataStreamSession._update_latency,
    ObjectType.OBJECT_QUALITY: DataStreamSession._update_qualities,
    ObjectType.GLOBAL_SEGMENTS: DataStreamSession._update_segments,
}
