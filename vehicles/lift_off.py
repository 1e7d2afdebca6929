"""Proof of a lift-off: whether the pose of a vehicle answers its own rotor.

From arming until its pose has risen, nothing of a vehicle is proved: the pose may be frozen or that of
another body, and the radio may move another rotor. `LiftOffProof` names what shows that it is.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

from rcopterx.vehicles.state import GRAVITY_M_S2
from rcopterx.vehicles.tuples import Three

PROVED_M: Final = 0.1  # a mean pose so far above the standing one flies...
CLEAR_M: Final = 0.4  # ...and one so far above it jumps visibly if another body on the floor takes its place
ROSE_M: Final = 0.003  # one so far above it has risen
WEAK_SHARE: Final = 0.7  # of the hover thrust, which lifts no vehicle
UNSEEN_M_S: Final = 0.8  # speed that a vehicle that hovers with this thrust may have reached unseen
AGAIN_M_S: Final = 0.3  # of which a vehicle that is seen to stand again has reached so much at most
RESTING_SHARE: Final = 0.76  # of the hover thrust: all vehicles sink gently with it
SINKING_S: Final = 1.2  # time in which a vehicle sinks after a problem
LONGEST_SINK_S: Final = 6.0  # ...if it is seen above the floor and not still...
STILL_S, STILL_M = 0.6, 0.02  # ...for so long within so much: in the air its thrust falls until it sinks
SINK_M_S: Final = 0.4  # climb rate wanted then, downwards
SINK_PER_M_S: Final = 0.25  # shares of the hover thrust per error of the climb rate...
SINK_PER_M: Final = 0.3  # ...and per its integral
# Shares of the hover thrust that may carry it, as it was seen. The poses may be of another body.
LEAST_REST, MOST_REST = 0.3, 1.0
STOPPED_M: Final = 0.003  # a vehicle that has risen moves on by so much before it may be so fast unseen
AVERAGED_S: Final = 0.045  # time of a mean of poses
STARTED: Final = 0.02  # share of the hover thrust from which on the vehicle is not in a hand
TURNING: Final = 0.2  # share of the hover thrust from which on the rotor may do harm
REPEATED_S: Final = 0.08  # a position that repeats itself exactly for so long...
REPEATED: Final = 3  # ...and so often is frozen
ASIDE_M: Final = 0.05  # from where it stood, without rising
GAP_S: Final = 0.1  # after so long without a pose it may have slid
WAITED_S: Final = 0.5  # for so long poses may have waited for a process that was stopped
LOW_M: Final = 0.02  # a vehicle that is lower has not risen enough to move sideways
TILT_RAD: Final = 0.35
JUMP_M: Final = 0.03
DROP_M: Final = 0.012  # below where it would be in free fall after less than `DROPPED_S`
DROPPED_S: Final = 0.05
FASTEST_M_S: Final = 1.5
STANDING_WEIGHT: Final = 0.1  # of a new pose in the mean of where the vehicle stands
MAT_M: Final = 0.02  # by so much a vehicle may rise from a soft mat under a rotor that does not lift it
OTHER_AVERAGED: Final = 3  # poses in the mean height of another vehicle
JUMPED: Final = "its pose jumped"  # after that it may be of another body, or in other axes
NOT_RISEN: Final = (
    "its pose did not rise: charge its battery, raise hover_thrust, or is its subject another body?"
)


def braked(climb_m_s: float, share: float, lag_s: float) -> bool:
    """Whether a climb ends while the thrust rises from a share of the hover thrust to `RESTING_SHARE`.

    A vehicle that climbs is braked without thrust until then; `lag_s` is the first-order lag of its rotor.
    """
    return climb_m_s <= GRAVITY_M_S2 * lag_s * (RESTING_SHARE - share)


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


class _Other:
    """Another vehicle that stands: where, and its newest heights."""

    def __init__(self, height_m: float) -> None:
        self.stands_m = height_m
        self.newest_m: deque[float] = deque(maxlen=OTHER_AVERAGED)


class LiftOffProof:
    """Watches one lift-off; `problem` is the first reason to end it, and stays until `begin`.

    Without limits every lift-off counts as proved.
    """

    def __init__(self, vehicle: str, limits: LiftOffLimits | None, trust_repeated: bool) -> None:
        self._bounded, self._limits = limits is not None, limits or LiftOffLimits()
        self._vehicle, self._trust_repeated = vehicle, trust_repeated
        self.begin()

    def begin(self, *, proved: bool = False, thrust: float = 0.0) -> None:
        """Begin: the vehicle stands with its rotor off, or flies (`proved`) under a thrust that acts."""
        self.proved = self._clear = proved or not self._bounded
        self.problem: str | None = None
        self._acting = thrust  # after the rotor's lag
        self._stands: SeenPose | None = None
        self._newest: deque[tuple[float, Three]] = deque()
        self._changed_s = -math.inf
        self._repeats = 0
        self._tried = False
        self._rise_m = self._climb_m_s = 0.0  # as seen
        self._unseen_m = self._unseen_m_s = 0.0  # height and climb rate of a vehicle like its model
        self._sunk_s, self._flew, self._braked = 0.0, False, False  # since a problem
        self._ended_m: float | None = None  # height seen just after it
        self._answers, self._rest, self._blind_s = False, RESTING_SHARE, 0.0
        self._still_m, self._still_since_s = 0.0, -math.inf
        self._moved_m = self._moved_m_s = 0.0  # seen height and unseen climb rate when it moved last
        self._others: dict[str, _Other] = {}

    @property
    def share(self) -> float:
        """Thrust after the rotor's lag, as a share of the hover thrust."""
        return self._acting / self._limits.hover_thrust

    @property
    def turning(self) -> bool:
        """Whether the rotor turns fast enough to do harm."""
        return self._acting > TURNING * self._limits.hover_thrust

    @property
    def explained_m(self) -> float:
        """Height above the floor at which the own rotor, as it has turned so far, may have brought it."""
        if self.proved or self._tried:
            return math.inf
        return MAT_M if self.turning else ROSE_M

    @property
    def sinking(self) -> bool:
        """Whether a vehicle that may have left the floor still sinks to it after a problem."""
        limit_s = LONGEST_SINK_S if self._aloft else SINKING_S
        return self.problem is not None and self._sunk_s < limit_s

    @property
    def _aloft(self) -> bool:
        """Whether it is seen above the floor after a problem, and not standing on something."""
        still = bool(self._newest) and self._newest[-1][0] >= self._still_since_s + STILL_S
        seen = self._ended_m is not None and self._repeats < REPEATED and self._blind_s < WAITED_S
        return seen and self._rise_m > MAT_M and not still

    @property
    def unfinished(self) -> bool:
        """Whether it has left the floor and proved nothing yet."""
        return self.problem is None and not self.proved and self._rise_m > ROSE_M

    @property
    def sinking_thrust(self) -> float:
        """Thrust that brings it to the floor gently, by its climb rate if its pose answers, else without."""
        if self.problem is not None and self._answers:
            too_fast_m_s = self._climb_m_s + SINK_M_S
            share = min(max(self._rest - SINK_PER_M_S * too_fast_m_s, 0.0), MOST_REST)
            return share * self._limits.hover_thrust
        sinks = self._flew and self._braked
        if self.unfinished:
            climb_m_s = min(self._climb_m_s, self._unseen_m_s)  # poses may be missing meanwhile
            sinks = braked(climb_m_s, self.share, self._limits.rotor_lag_s)
        return RESTING_SHARE * self._limits.hover_thrust if sinks else 0.0

    def thrust(self, applied: float, elapsed_s: float, *, stands: bool) -> None:
        """Use the thrust applied for the last `elapsed_s`; a vehicle that `stands` has to prove the next."""
        if stands and self._bounded:
            if self._tried and not self.proved:
                self._end(NOT_RISEN)
                self._sunk_s = math.inf
            elif self.proved and self.problem is None:
                self.begin()
        self._tried = self._tried or self._acting > WEAK_SHARE * self._limits.hover_thrust
        self._acting -= math.expm1(-elapsed_s / self._limits.rotor_lag_s) * (applied - self._acting)
        if self._clear:
            return
        self._unseen_m_s += GRAVITY_M_S2 * (self.share - 1.0) * elapsed_s
        self._unseen_m += self._unseen_m_s * elapsed_s
        if self._unseen_m <= 0.0:
            self._unseen_m, self._unseen_m_s = 0.0, max(self._unseen_m_s, 0.0)
        if self.problem is not None:
            self._sunk_s += elapsed_s
            self._blind_s += elapsed_s
            self._braked = self._braked or braked(self._unseen_m_s, self.share, self._limits.rotor_lag_s)
        elif self._rise_m < ROSE_M and self._unseen_m_s > UNSEEN_M_S:
            self._end(NOT_RISEN)

    def own(self, pose: SeenPose, now_s: float, captured_s: float = 0.0) -> None:
        """Use a pose of the own vehicle, captured so long after the last one.

        Poses that have waited arrive at once; they count as at least as far apart as they were captured.
        """
        if self._clear:
            return
        last = self._newest[-1] if self._newest else None
        if last is not None:
            now_s = max(now_s, min(last[0] + captured_s, now_s + WAITED_S))
        self._count_repeats(pose.position_m, now_s)
        if last is not None and self._acting > STARTED * self._limits.hover_thrust:
            self._judge_step(pose.position_m, now_s - last[0], last[1])
        self._newest.append((now_s, pose.position_m))
        while self._newest[0][0] < now_s - AVERAGED_S:
            self._newest.popleft()
        if self._stands is None or not (self.turning or self.proved or self.problem):
            self._stands = _standing(self._stands, pose)
            return
        if last is not None and now_s > last[0] + GAP_S:
            # Where it moved meanwhile was not seen.
            x, y, _ = pose.position_m
            self._stands = SeenPose((x, y, self._stands.position_m[2]), self._stands.tilt_rad)
            self._moved_m_s = self._unseen_m_s
        if self._repeats == 0:
            self._follow(self._stands.position_m[2])
            if self.problem is not None:
                self._watch_descent(now_s, 0.0 if last is None else min(now_s - last[0], GAP_S))
        if not self.proved and self.problem != JUMPED:
            self._judge(pose, self._stands)
        self._clear = self.proved and self.problem is None and self._rise_m > CLEAR_M

    def other(self, name: str, height_m: float, explained_m: float) -> None:
        """Use the height of another vehicle, which its own rotor may lift by `explained_m`."""
        if self.proved:
            return
        other = self._others.setdefault(name, _Other(height_m))
        other.newest_m.append(height_m)
        rise_m = math.fsum(other.newest_m) / len(other.newest_m) - other.stands_m
        if not self.turning:
            other.stands_m += STANDING_WEIGHT * rise_m
        elif rise_m > explained_m and self._rise_m < 0.5 * rise_m:
            self._end(f"{name} rose when the rotor of {self._vehicle} turned: subjects or radios exchanged?")

    def _count_repeats(self, position_m: Three, now_s: float) -> None:
        if self._trust_repeated or not self._newest or position_m != self._newest[-1][1]:
            self._changed_s, self._repeats = now_s, 0
            return
        self._repeats += 1
        if self.turning and self._repeats >= REPEATED and now_s >= self._changed_s + REPEATED_S:
            self._end("its pose repeats itself exactly: frozen")

    def _judge_step(self, position_m: Three, elapsed_s: float, last_m: Three) -> None:
        """Judge a new position by the last one."""
        jumped = math.dist(last_m, position_m) > JUMP_M + FASTEST_M_S * min(elapsed_s, 0.3)
        falling_m = 0.5 * GRAVITY_M_S2 * elapsed_s**2 - self._climb_m_s * elapsed_s
        dropped = elapsed_s < DROPPED_S and last_m[2] - position_m[2] > DROP_M + falling_m
        if jumped or dropped:
            self._end(JUMPED)

    def _follow(self, stands_m: float) -> None:
        """Estimate height and climb rate from the newest poses."""
        before_m = self._rise_m
        self._rise_m = math.fsum(place[2] for _, place in self._newest) / len(self._newest) - stands_m
        (first_s, first), (last_s, last) = self._newest[0], self._newest[-1]
        self._climb_m_s = (last[2] - first[2]) / (last_s - first_s) if last_s > first_s else 0.0
        if self._rise_m <= ROSE_M < before_m and self.problem is None:
            self._unseen_m, self._unseen_m_s = 0.0, min(self._unseen_m_s, AGAIN_M_S)

    def _watch_descent(self, now_s: float, elapsed_s: float) -> None:
        """Note after a problem whether its pose still moves, and what share of the thrust carries it."""
        self._blind_s = 0.0
        if self._ended_m is None:
            self._ended_m = self._rise_m
        if abs(self._rise_m - self._still_m) > STILL_M:
            self._still_m, self._still_since_s = self._rise_m, now_s
        moved = abs(self._rise_m - self._ended_m) > PROVED_M
        self._answers = self._answers or moved or (self._aloft and self._sunk_s >= SINKING_S)
        if self._answers:
            rest = self._rest - SINK_PER_M * elapsed_s * (self._climb_m_s + SINK_M_S)
            self._rest = min(max(rest, LEAST_REST), MOST_REST)

    def _judge(self, pose: SeenPose, stands: SeenPose) -> None:
        """Judge the mean of the newest poses against where the vehicle stood."""
        rise_m = self._rise_m
        x, y = (math.fsum(place[axis] for _, place in self._newest) / len(self._newest) for axis in (0, 1))
        if rise_m < LOW_M and math.dist((x, y), stands.position_m[:2]) > ASIDE_M:
            self._end("its pose moved sideways without rising")
        if pose.tilt_rad is not None and stands.tilt_rad is not None:
            tilted_rad = abs(pose.tilt_rad - stands.tilt_rad)
            if tilted_rad > TILT_RAD:
                self._end(f"it tilted by {math.degrees(tilted_rad):.0f} degrees")
                self._sunk_s = math.inf  # it would not sink but slide
        if rise_m > MAT_M and not self._tried:
            self._end("its pose rose while its rotor could not lift it: subjects or radios exchanged?")
        low_m = ROSE_M if self._acting > self._limits.hover_thrust else MAT_M
        if rise_m < low_m or abs(rise_m - self._moved_m) > STOPPED_M:
            self._moved_m, self._moved_m_s = rise_m, self._unseen_m_s
        elif self._unseen_m_s > self._moved_m_s + UNSEEN_M_S:
            self._end("its pose rose and stopped: is its subject another body?")
        self.proved = self.problem is None and rise_m > PROVED_M

    def _end(self, problem: str) -> None:
        if self.problem is None:
            self.problem = problem
            if self._rise_m > ROSE_M:
                since_s = max(self._newest[-1][0] - self._changed_s, 0.0)
                self._unseen_m = self._rise_m + self._climb_m_s * since_s
                self._unseen_m_s = self._climb_m_s
            self._flew = self._unseen_m > 0.0
            self._newest.clear()  # poses before a jump say nothing of the speed after it


def _standing(before: SeenPose | None, pose: SeenPose) -> SeenPose:
    """Mean of where a vehicle stands; a new one for a vehicle that was carried."""
    if before is None or math.dist(before.position_m, pose.position_m) > ASIDE_M:
        return pose
    x, y, z = (
        old + STANDING_WEIGHT * (new - old)
        for old, new in zip(before.position_m, pose.position_m, strict=True)
    )
    return SeenPose((x, y, z), pose.tilt_rad)
