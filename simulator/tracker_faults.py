"""Faults of the Tracker emulator (docs/motion_capture.md), on request or by a time table."""

import math
import random
from collections import deque
from collections.abc import Iterable, Sequence
from typing import TypeVar

import numpy as np

from rcopterx.simulator import faults
from rcopterx.simulator.tracker_frame import TrackedBody, TrackerFrame
from rcopterx.vehicles.state import three
from rcopterx.vicon_gateway.wire import ObjectType

NOISE_SEED = 1  # the same fault shows the same noise


_F = TypeVar("_F", bound=faults.LastingFault)


class TrackerFaults:
    """Active faults and their effect on a captured frame; the server carries out those of connections.

    `offer` are the object types of the Tracker; faults that need others are refused.
    """

    def __init__(self, offer: frozenset[int]) -> None:
        # lines of a time table that could not be carried out when their time came, the newest last
        self.refused: deque[str] = deque(maxlen=20)
        self._offer = offer
        self._subjects: frozenset[str] | None = None
        self.table: faults.FaultTable[faults.TrackerFault, faults.LastingFault] = faults.FaultTable()
        self._pending: list[faults.TrackerFault] = []
        self._frame_offset = 0
        self._next_frame_id: int | None = None
        self._last: TrackerFrame | None = None
        self._frozen: dict[str, TrackedBody] = {}
        self._now_s = 0.0
        self._skipped = 0
        self._random = random.Random(NOISE_SEED)

    def apply(self, fault: faults.TrackerFault, now_s: float) -> None:
        """Start a fault now; `FaultError` for an unknown subject, or what this Tracker does not offer."""
        self._check(fault)
        match fault:
            case faults.LastingFault():
                self.table.begin(fault, now_s)
            case faults.Recover():
                self.table.end()
            case faults.ResetFrameId(frame):
                self._next_frame_id = frame
            case _:
                self._pending.append(fault)

    def schedule(self, table: Iterable[faults.TimedFault], start_s: float) -> None:
        """Apply faults later, at `start_s` plus their time, not those for radios; all or `FaultError`."""
        lines = [
            (line.at_s, line.fault)
            for line in table
            if not isinstance(line.fault, faults.BreakRadio | faults.BreakVehicle)
        ]
        planned = frozenset(fault.subject for _, fault in lines if isinstance(fault, faults.AddSubject))
        for _, fault in lines:
            self._check(fault, planned)
        for at_s, fault in lines:
            self.table.add(start_s + at_s, fault)

    def advance(self, now_s: float) -> None:
        """Start and end faults that are due."""
        self._now_s = now_s
        for at_s, fault in self.table.due(now_s):
            try:
                self.apply(fault, at_s)
            except faults.FaultError as error:
                self.refused.append(str(error))
        self.table.end(now_s)

    def active(self, kind: type[_F]) -> _F | None:
        """Return the active fault of a kind that concerns no particular subject; None without one."""
        entry = self.table.lasting.get((kind, None))
        return entry.fault if entry is not None and isinstance(entry.fault, kind) else None

    def take_pending(self) -> list[faults.TrackerFault]:
        """Return and forget faults that act once on connections or packets."""
        pending, self._pending = self._pending, []
        return pending

    def transform(self, frame: TrackerFrame) -> TrackerFrame:
        """Return the frame as the faulty Tracker captures it."""
        if self._next_frame_id is not None:
            self._frame_offset = self._next_frame_id - frame.frame
            self._next_frame_id = None
        self._subjects = frozenset([body.name for body in frame.bodies])
        if self.active(faults.Freeze) is not None and self._last is not None:
            return self._last
        bodies = self._with_frozen(frame.bodies) if self.table.lasting or self._frozen else frame.bodies
        for entry in self.table.lasting.values():
            bodies = self._changed(bodies, entry)
        number = (frame.frame + self._frame_offset) % (faults.MAX_FRAME_ID + 1)
        self._last = TrackerFrame(number, bodies, frame.latency_samples)
        return self._last

    def skips(self) -> bool:
        """Whether the next frame is not sent; to be called once for each frame."""
        if (fault := self.active(faults.SkipFrames)) is None:
            self._skipped = 0
            return False
        self._skipped = (self._skipped + 1) % fault.one_of
        return self._skipped != 0

    def _changed(
        self, bodies: tuple[TrackedBody, ...], entry: faults.Lasting[faults.LastingFault]
    ) -> tuple[TrackedBody, ...]:
        """Return the bodies as they appear under one fault."""
        match entry.fault:
            case faults.RemoveSubject(subject=name):
                return tuple(body for body in bodies if body.name != name)
            case faults.AddSubject(subject=name, position_m=position_m, way=way):
                listed, age_s = any(body.name == name for body in bodies), self._now_s - entry.started_s
                times_s, *axes_m = zip((0.0, *position_m), *way, strict=True)
                place_m = three(np.array([np.interp(age_s, times_s, axis_m) for axis_m in axes_m]))
                return bodies if listed else (*bodies, TrackedBody(name, place_m))
            case faults.SwapSubjects(subject=first, other=second):
                return _swapped(bodies, first, second)
            case fault:
                only = fault.subject if isinstance(fault, faults.SubjectFault) else None
                return tuple(
                    self._body_under(entry, body) if only in (None, body.name) else body for body in bodies
                )

    def _body_under(self, entry: faults.Lasting[faults.LastingFault], body: TrackedBody) -> TrackedBody:
        """Return a body as it appears under a fault that concerns it."""
        match entry.fault:
            case faults.DisplacePose(offset_m=offset_m, velocity_m_s=velocity_m_s):
                age_s = self._now_s - entry.started_s
                by_m = [offset + age_s * speed for offset, speed in zip(offset_m, velocity_m_s, strict=True)]
                return _moved(body, by_m)
            case faults.AddNoise(deviation_m=deviation_m) | faults.StandIn(deviation_m=deviation_m):
                return _moved(body, [self._random.gauss(0.0, deviation_m) for _ in range(3)])
            case faults.TurnPose(yaw_rad=yaw_rad):
                return _turned(body, yaw_rad)
            case faults.Millimetres():
                x, y, z = body.position_m
                return body._replace(position_m=(1000.0 * x, 1000.0 * y, 1000.0 * z))
            case faults.Occlude():
                return body._replace(occluded=True)
            case faults.SetQuality(quality=quality):
                return body._replace(quality=quality)
            case faults.RenameRootSegment(segment=segment):
                return body._replace(root_segment=segment)
        return body

    def _with_frozen(self, bodies: tuple[TrackedBody, ...]) -> tuple[TrackedBody, ...]:
        """Return the bodies with those that are to stand still where they were first."""
        names = self._subjects_with(faults.FreezePose) | self._subjects_with(faults.StandIn)
        seen = {body.name: body for body in bodies}
        self._frozen = {name: self._frozen.get(name, seen[name]) for name in names & seen.keys()}
        return tuple(self._frozen.get(body.name, body) for body in bodies)

    def _subjects_with(self, kind: type[faults.FreezePose | faults.StandIn | faults.AddSubject]) -> set[str]:
        return {fault.subject for fault in self.table.active if isinstance(fault, kind)}

    def _check(self, fault: faults.TrackerFault, planned: frozenset[str] = frozenset()) -> None:
        if isinstance(fault, faults.SetQuality) and ObjectType.OBJECT_QUALITY not in self._offer:
            raise faults.FaultError("set_quality: this Tracker does not offer ObjectQuality (tracker3 does)")
        if isinstance(fault, faults.UnknownObject) and fault.object_type in ObjectType.__members__.values():
            raise faults.FaultError(f"unknown_object: {fault.object_type} is the number of a known type")
        if self._subjects is None:
            return
        tracked = self._subjects | self._subjects_with(faults.AddSubject) | planned
        if isinstance(fault, faults.AddSubject):
            if fault.subject in self._subjects:
                raise faults.FaultError(f"add_subject: {fault.subject!r} is tracked already")
            return
        for name in (getattr(fault, field, None) for field in ("subject", "other")):
            if name is not None and name not in tracked:
                raise faults.FaultError(
                    f"no subject {name!r}; tracked are {', '.join(map(repr, sorted(tracked)))}"
                )


def _moved(body: TrackedBody, by_m: Sequence[float]) -> TrackedBody:
    x, y, z = (place + by for place, by in zip(body.position_m, by_m, strict=True))
    return body._replace(position_m=(x, y, z))


def _turned(body: TrackedBody, yaw_rad: float) -> TrackedBody:
    """Turn a body about its own vertical axis."""
    x, y, z, w = body.quaternion_xyzw
    sine, cosine = math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)
    turned = (x * cosine + y * sine, y * cosine - x * sine, z * cosine + w * sine, w * cosine - z * sine)
    return body._replace(quaternion_xyzw=turned)


def _swapped(bodies: tuple[TrackedBody, ...], first: str, second: str) -> tuple[TrackedBody, ...]:
    """Exchange the poses of two subjects; names and segments stay where they are."""
    seen = {body.name: body for body in bodies}
    if first not in seen or second not in seen:
        return bodies
    seen[first], seen[second] = seen[second], seen[first]
    return tuple(seen[body.name]._replace(name=body.name, root_segment=body.root_segment) for body in bodies)
