"""Whether the pose of a vehicle on the floor is plausible; only then it is armed."""

import math
from collections.abc import Callable, Mapping

from rcopterx.radios.limits import ArbiterLimits
from rcopterx.transmitter_gateway.inputs import PoseInput, Position

OTHER_UNIT = 10.0  # beyond so many times the size of the volume, a position is not in metres


class Standing:
    """Judges the poses of one vehicle while it stands on the floor; `restart` whenever it flies.

    `other_places` returns the places of the other vehicles that are seen at a time.
    """

    def __init__(
        self, vehicle: str, limits: ArbiterLimits, other_places: Callable[[float], Mapping[str, Position]]
    ) -> None:
        self._vehicle, self._other_places = vehicle, other_places
        self._limits, self._standing = limits, limits.standing
        self.restart()

    def restart(self) -> None:
        """Forget what was seen."""
        self._pose: PoseInput | None = None
        self._arrived_s = self._moved_s = -math.inf
        self._watched_s = self._repeated_s = self._moved_m = 0.0
        self._rest_m: Position | None = None  # where the vehicle has been since it moved last

    def observe(self, pose: PoseInput, now_s: float) -> None:
        """Take a pose of a new frame; occluded ones do not count."""
        position, last, limits = pose.position_m, self._pose, self._standing
        if position is None or limits is None:
            return
        # A stream that is slower than it should be does not repeat itself: every frame counts once.
        step_s = 0.0 if last is None else pose.period_s or now_s - self._arrived_s
        same = last is not None and position == last.position_m
        self._repeated_s = self._repeated_s + step_s if same else 0.0
        self._watched_s += step_s
        self._pose, self._arrived_s = pose, now_s
        distance_m = 0.0 if self._rest_m is None else math.dist(position, self._rest_m)
        if self._rest_m is None or distance_m > limits.moved_m:
            self._rest_m = position
        if distance_m > limits.moved_m:
            self._moved_s, self._moved_m = now_s, distance_m

    def problems(self, now_s: float, *, arming: bool = False) -> list[str]:
        """Sentences on what is not plausible, each with the likely cause; stricter where it is `arming`."""
        limits, pose = self._standing, self._pose
        if limits is None:
            return []
        if arming and self._watched_s < limits.watched_s:
            return [f"seen for {self._watched_s:.1f} s on the floor, {limits.watched_s:g} s are needed"]
        if pose is None or pose.position_m is None:
            return []
        others = self._other_places(now_s)
        shared = [
            f"{self._vehicle} is shown where {other} is: one body for two subjects?"
            for other, place in others.items()
            if math.dist(place, pose.position_m) < limits.apart_m
        ]
        minimum_m = self._limits.surveillance.minimum_distance_m or 0.0
        shared += [
            f"{self._vehicle} stands {distance_m:.2f} m from {other}, closer than {minimum_m:g} m: move one"
            for other, place in others.items()
            if limits.apart_m <= (distance_m := math.dist(place, pose.position_m)) < minimum_m
        ]
        # All subjects have the same axes and origin.
        below = [line for other, place in others.items() if (line := self._below(other, place))]
        return [*self.own_problems(now_s), *shared, *below]

    def own_problems(self, now_s: float) -> list[str]:
        """Those of the own pose alone."""
        limits, pose, name = self._standing, self._pose, self._vehicle
        if limits is None or pose is None or pose.position_m is None:
            return []
        found = self._of_place(pose.position_m)
        trusted = self._limits.surveillance.trust_repeated_poses
        if not trusted and self._repeated_s >= limits.repeated_s:
            found.append(
                f"{name}: its position has repeated itself exactly for {self._repeated_s:.1f} s, as no "
                "measurement does: is the pose frozen? See that cameras see its markers"
            )
        if (pose.tilt_rad or 0.0) > limits.tilt_rad:
            found.append(
                f"{name} is tilted by {math.degrees(pose.tilt_rad or 0.0):.0f} deg: overturned, Y up, or was "
                "the object created with other axes?"
            )
        if now_s < self._moved_s + limits.rest_s:
            found.append(
                f"{name} moves: {1e3 * self._moved_m:.0f} mm on the floor within the last "
                f"{limits.rest_s:g} s; put it down, or is its pose that of another subject?"
            )
        return found

    def _of_place(self, position: Position) -> list[str]:
        limits, name, fence = self._standing, self._vehicle, self._limits.surveillance.fence
        assert limits is not None
        if line := self._below(name, position):
            return [line]
        if fence is not None and not fence.beside(position):
            x, y, z = position
            far = math.dist(position, fence.lower_m) > OTHER_UNIT * math.dist(fence.lower_m, fence.upper_m)
            cause = "millimetres?" if far else "put it inside, or is the origin another one?"
            return [f"{name} is shown at ({x:.2f}, {y:.2f}, {z:.2f}) m, outside the volume: {cause}"]
        above_m = position[2] - self._limits.floor_m
        if above_m <= limits.highest_m:
            return []
        return [
            f"{name} stands at z = {position[2]:.2f} m, {above_m:.2f} m above the floor: Y up, or another "
            "origin? From a table, raise safety.settings.standing.highest_m"
        ]

    def _below(self, name: str, position: Position) -> str | None:
        limits, height_m = self._standing, position[2]
        if limits is None or height_m >= self._limits.floor_m - limits.below_m:
            return None
        return f"{name} stands at z = {height_m:.2f} m, below the floor: Y up, or another origin?"
