"""Recordings for identification, from poses and applied inputs as they are on the bus."""

from collections import deque
from collections.abc import Sequence
from typing import Final

import numpy as np

from rcopterx.bus.messages import Applied, Pose
from rcopterx.control.identification.recording import FlightLog, FlightRecording, RecordingError
from rcopterx.control.interfaces import Measurement

WINDOW_S: Final = 60.0  # of the flight that is kept


def recording_of(
    poses: Sequence[Pose], applied: Sequence[Applied], kind: str, period_s: float
) -> FlightRecording:
    """Return the flight of a vehicle of type `kind` with a control period.

    Raises `RecordingError` for gaps, a restart, an override by the arbiter, or nothing applied.
    """
    fresh = [one for one in applied if one.fresh]
    if not poses or not fresh:
        raise RecordingError("no poses, or no commands, were on the bus")
    if others := sorted({one.state for one in fresh} - {"armed"}):
        raise RecordingError(f"the arbiter was {', '.join(others)} meanwhile")
    if len({pose.epoch for pose in poses}) > 1:
        raise RecordingError("the motion capture restarted meanwhile")
    log, first = FlightLog(kind, period_s), fresh[0].frame
    frames = max(1, round(period_s / poses[0].period_s))
    for pose in poses:
        row, between = divmod(pose.frame - first, frames)
        if between == 0 and pose.position_m is not None and pose.quaternion_xyzw is not None:
            log.add_pose(row, Measurement.of_pose(pose.position_m, pose.quaternion_xyzw))
    for one in fresh:
        log.add_input((one.frame - first) // frames, np.array(one.input))
    return log.recording()


class OrdinaryFlight:
    """The last `WINDOW_S` in which a vehicle flew freely; everything else begins it anew."""

    def __init__(self, kind: str, period_s: float) -> None:
        self._kind, self._period_s = kind, period_s
        self._poses: deque[Pose] = deque()
        self._applied: deque[Applied] = deque()

    def restart(self) -> None:
        """Forget what was flown."""
        self._poses.clear()
        self._applied.clear()

    def add_pose(self, pose: Pose) -> None:
        """Add a pose."""
        if self._poses and pose.epoch != self._poses[-1].epoch:
            self.restart()
        self._poses.append(pose)
        oldest = pose.frame - WINDOW_S / pose.period_s
        for kept in (self._poses, self._applied):
            while kept and kept[0].frame < oldest:
                kept.popleft()

    def add_applied(self, applied: Applied) -> None:
        """Add an input that was written to the radio; only those of a freely flying vehicle count."""
        if applied.state != "armed":
            self.restart()
        elif applied.fresh:
            self._applied.append(applied)

    @property
    def duration_s(self) -> float:
        """Duration of what is kept."""
        if not self._poses or not self._applied:
            return 0.0
        first = max(self._poses[0].frame, self._applied[0].frame)
        return max(0, self._poses[-1].frame - first) * self._poses[-1].period_s

    @property
    def extent_m(self) -> float:
        """Larger horizontal side of the box in which the vehicle has stayed."""
        places = np.array([pose.position_m[:2] for pose in self._poses if pose.position_m is not None])
        return float(np.ptp(places, axis=0).max()) if len(places) else 0.0

    def recording(self) -> FlightRecording:
        """Return what is kept; errors of `recording_of`, after which it begins anew."""
        try:
            return recording_of(self._poses, self._applied, self._kind, self._period_s)
        except RecordingError:
            self.restart()
            raise
