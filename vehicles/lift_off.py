"""Proof of a lift-off: whether the pose of a vehicle answers its own rotor.

From arming until its pose has risen, nothing of a vehicle is proved: the pose may be frozen or that of
another body. `LiftOffProof` names what shows that it is.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

from rcopterx.vehicles.tuples import Three

PROVED_M: Final = 0.02  # a mean pose so far above the standing one flies
AVERAGED_S: Final = 0.045  # time of a mean of poses
TURNING: Final = 0.2  # share of the hover thrust from which on the rotor may do harm
REPEATED_S: Final = 0.08  # a position that repeats itself exactly for so long...
REPEATED: Final = 3  # ...and so often is frozen
ASIDE_M: Final = 0.05
TILT_RAD: Final = 0.35
JUMP_M: Final = 0.1
FASTEST_M_S: Final = 2.5
STANDING_WEIGHT: Final = 0.1  # of a new pose in the mean of where the vehicle stands


@dataclass(frozen=True, slots=True)
class LiftOffLimits:
    """What the proof of a lift-off needs of a vehicle. Raises `ValueError`, which names the field."""

    hover_thrust: float = 0.55
    """Thrust stick at which the model hovers."""
    rotor_lag_s: float = 0.1
    """First-order lag of the thrust."""

    def __post_init__(self) -> None:
        for name in ("hover_thrust", "rotor_lag_s"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name}: {value} must be a positive number")


class SeenPose(NamedTuple):
    """A pose on the floor; `tilt_rad` is the angle between rotor axis and the vertical."""

    position_m: Three
    tilt_rad: float | None = None


class LiftOffProof:
    """Watches one lift-off; `problem` is the first reason to end it, and stays until `begin`.

    Without limits every lift-off counts as proved.
    """

    def __init__(self, limits: LiftOffLimits | None, trust_repeated: bool) -> None:
        self._bounded, self._limits = limits is not None, limits or LiftOffLimits()
        self._trust_repeated = trust_repeated
        self.begin()

    def begin(self, *, proved: bool = False) -> None:
        """Begin: the vehicle stands with its rotor off, or flies (`proved`)."""
        self.proved = proved or not self._bounded
        self.problem: str | None = None
        self._acting = 0.0  # thrust after the rotor's lag
        self._stands: SeenPose | None = None
        self._newest: deque[tuple[float, Three]] = deque()
        self._changed_s = -math.inf
        self._repeats = 0

    @property
    def turning(self) -> bool:
        """Whether the rotor turns fast enough to do harm."""
        return self._acting > TURNING * self._limits.hover_thrust

    def thrust(self, applied: float, elapsed_s: float, *, stands: bool) -> None:
        """Use the thrust applied for the last `elapsed_s`; a vehicle that `stands` has to prove the next."""
        if self.proved and stands and self._bounded:
            self.begin()
        self._acting -= math.expm1(-elapsed_s / self._limits.rotor_lag_s) * (applied - self._acting)

    def own(self, pose: SeenPose, now_s: float) -> None:
        """Use a pose of the own vehicle."""
        if self.proved:
            return
        self._count_repeats(pose.position_m, now_s)
        last = self._newest[-1] if self._newest else None
        self._newest.append((now_s, pose.position_m))
        while self._newest[0][0] < now_s - AVERAGED_S:
            self._newest.popleft()
        if self._stands is None or not self.turning:
            self._stands = _standing(self._stands, pose)
            return
        if last is not None:
            reach_m = JUMP_M + FASTEST_M_S * min(now_s - last[0], 0.3)
            if math.dist(last[1], pose.position_m) > reach_m:
                self._end("its pose jumped")
        self._judge(pose, self._stands)

    def _count_repeats(self, position_m: Three, now_s: float) -> None:
        if self._trust_repeated or not self._newest or position_m != self._newest[-1][1]:
            self._changed_s, self._repeats = now_s, 0
            return
        self._repeats += 1
        if self.turning and self._repeats >= REPEATED and now_s >= self._changed_s + REPEATED_S:
            self._end("its pose repeats itself exactly: frozen")

    def _judge(self, pose: SeenPose, stands: SeenPose) -> None:
        """Judge the mean of the newest poses against where the vehicle stood."""
        places = [place for _, place in self._newest]
        x, y, z = (math.fsum(axis) / len(places) for axis in zip(*places, strict=True))
        rise_m = z - stands.position_m[2]
        if math.dist((x, y), stands.position_m[:2]) > max(ASIDE_M, 2 * rise_m):
            self._end("its pose moved sideways without rising")
        if pose.tilt_rad is not None and stands.tilt_rad is not None:
            tilted_rad = abs(pose.tilt_rad - stands.tilt_rad)
            if tilted_rad > TILT_RAD:
                self._end(f"it tilted by {math.degrees(tilted_rad):.0f} degrees")
        self.proved = self.problem is None and rise_m > PROVED_M

    def _end(self, problem: str) -> None:
        if self.problem is None:
            self.problem = problem


def _standing(before: SeenPose | None, pose: SeenPose) -> SeenPose:
    """Mean of where a vehicle stands; a new one for a vehicle that was carried."""
    if before is None or math.dist(before.position_m, pose.position_m) > ASIDE_M:
        return pose
    x, y, z = (
        old + STANDING_WEIGHT * (new - old)
        for old, new in zip(before.position_m, pose.position_m, strict=True)
    )
    return SeenPose((x, y, z), pose.tilt_rad)
