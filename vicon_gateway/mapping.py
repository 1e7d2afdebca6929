"""Subject names of the Tracker to vehicle names of the fleet."""

from collections import Counter
from collections.abc import Mapping

from rcopterx.bus.host_messages import SubjectState
from rcopterx.vicon_gateway.frame import CapturedFrame, SubjectPose


class SubjectMap:
    """Assigns poses to vehicles and keeps account of all subjects.

    Subject names must match exactly (blanks count).
    """

    def __init__(self, vehicle_of_subject: Mapping[str, str]) -> None:
        self._vehicles = dict(vehicle_of_subject)
        self._listed: Counter[str] = Counter()
        self._occluded_since_s: dict[str, float] = {}

    def update(self, frame: CapturedFrame) -> list[tuple[str, SubjectPose]]:
        """Return (vehicle, pose) of every vehicle that a frame lists, occluded or not."""
        self._listed = Counter([pose.name for pose in frame.subjects])
        known: list[tuple[str, SubjectPose]] = []
        occluded: dict[str, float] = {}
        for pose in frame.subjects:
            vehicle = self._vehicles.get(pose.name)
            if vehicle is not None and self._listed[pose.name] == 1:
                known.append((vehicle, pose))
            if pose.occluded:
                occluded[pose.name] = self._occluded_since_s.get(pose.name, frame.received_s)
        self._occluded_since_s = occluded
        return known

    def states(self, now_s: float) -> tuple[SubjectState, ...]:
        """Return every configured and every listed subject; `now_s` is the clock of the frames."""
        states = []
        for name in dict.fromkeys((*self._vehicles, *self._listed)):
            since_s = self._occluded_since_s.get(name)
            listed = self._listed.get(name, 0)
            state = SubjectState(
                subject=name[:400],
                vehicle=self._vehicles.get(name),
                listed=listed > 0,
                occluded_s=None if since_s is None else max(0.0, now_s - since_s),
                ambiguous=listed > 1,
            )
            states.append(state)
        return tuple(states)
