"""Own judgement from raw poses, independent of every agent: tracking, fence, distance, thrust time."""

import math
from collections import Counter
from copy import copy

from msgspec import Struct

from rcopterx.radios.limits import Fence, SurveillanceLimits
from rcopterx.transmitter_gateway.inputs import PoseInput, Position, Track
from rcopterx.transmitter_gateway.landing import Motion
from rcopterx.transmitter_gateway.still_pose import StillPose

LONGEST_EXTRAPOLATION_S = 0.1
LARGEST_M_S2 = 5.0  # change of the velocity while frames of a vehicle did not arrive
DRIFT_M_S = 0.2  # drift of an unseen vehicle, left level, from where it would be...
LONGEST_DRIFT_S = 2.0
SINK_M_S2 = 2.5  # ...and largest sink in an open-loop descent, with an error of its hover thrust
SHORTEST_STEP_S = 1e-3
FORGET_AFTER_S = 1.0
MOST_OTHERS = 63
STANDING_M = 0.2  # markers of a vehicle that stands on the floor are not higher
LIFTED_M = 0.03  # above where it stood, a vehicle flies
SMALLEST_DISTANCE_M = 1e-3
JUMP_RAD = 0.7  # by more a heading does not change between two poses...
FASTEST_RAD_S = 6.0  # ...but while a vehicle turns so fast
CLEAR_M = 0.2  # beyond the smallest distance, vehicles that came too close have moved apart


class Judgement(Struct, frozen=True):
    """Reasons to HOLD and to DESCEND, None where there is none."""

    hold: str | None = None
    descend: str | None = None


class PoseMonitor:
    """Follows raw poses of one vehicle (`own_track`, and `newest`, accepted or not) and its neighbours."""

    def __init__(self, limits: SurveillanceLimits, counters: Counter[str]) -> None:
        self._limits = limits
        self._counters = counters
        self.own_track: Track | None = None
        self._others: dict[str, Track] = {}
        self._close: list[str] = []
        self._jumping_s: float | None = None  # for how long all poses have been rejected as jumps
        self._mistaken: str | None = None
        self._still_pose = StillPose()
        self._stood_at_m: float | None = None
        self.newest: PoseInput | None = None
        self.epoch_since_s = -math.inf  # since when the own poses have their epoch
        self.captured_s = 0.0  # from the capture of the newest own pose but one to that of the newest

    def own_pose(self, pose: PoseInput, now_s: float, *, airborne: bool, share: float | None = None) -> bool:
        """Process a pose of the own vehicle; return whether it is accepted, as any is on the floor.

        `share`: thrust that acts, as a share of the hover thrust, which an airborne vehicle has to answer.
        """
        track = self.own_track
        if (rejection := self._check(pose, track, now_s)) is not None:
            return self._reject(rejection)
        if track is None:
            track = self.own_track = Track(pose.epoch, pose.frame, now_s)
        self.captured_s = _captured_since_s(pose, track.epoch, track.frame) or 0.0
        track.undelivered_s = max(track.undelivered_s, min(self.captured_s, LONGEST_DRIFT_S))
        waited_s = now_s - track.arrived_s
        track.epoch, track.frame, track.arrived_s = pose.epoch, pose.frame, now_s
        if self.newest is None or pose.epoch != self.newest.epoch:
            self.epoch_since_s = now_s
        self.newest = pose
        position = pose.position_m
        self._watch_answer(position, share if airborne else None, now_s)
        if position is None:
            track.occluded = True
            return self._reject("occluded pose")
        if self._is_stuck(track, position, airborne):
            return self._reject("repeated pose")
        if airborne and self._is_jump(track, position, now_s):
            self._note_jump(waited_s)
            return self._reject("pose jump")
        self._jumping_s = None
        self._turn(track, pose, now_s, airborne=airborne)
        self._follow(track, pose, position, now_s, moving=airborne)
        track.position_m, track.seen_s = position, now_s
        track.occluded, track.undelivered_s = False, 0.0
        return True

    def _watch_answer(self, position: Position | None, share: float | None, now_s: float) -> None:
        """Distrust poses that stay where they are while the thrust rises."""
        if position is None or share is None:
            self._still_pose.begin()
            return
        self._still_pose.own(position[2], share, now_s)
        if self._still_pose.unanswered:
            self._mistaken = self._mistaken or "own pose does not answer the thrust: another body?"

    @property
    def doubtful(self) -> bool:
        """Whether the own poses do not answer the thrust so far; nothing is learned from them meanwhile."""
        return self._still_pose.doubtful

    def other_pose(self, pose: PoseInput, now_s: float) -> bool:
        """Take a pose of another vehicle; nothing of it is judged but its form and order."""
        track = self._others.get(pose.vehicle)
        rejection = self._check(pose, track, now_s)
        if rejection is None and track is None and len(self._others) >= MOST_OTHERS:
            rejection = "too many vehicles"
        if rejection is not None:
            return self._reject(rejection)
        if track is None:
            track = self._others[pose.vehicle] = Track(pose.epoch, pose.frame, now_s)
        track.epoch, track.frame, track.arrived_s = pose.epoch, pose.frame, now_s
        if pose.position_m is None:
            return self._reject("occluded pose")
        track.position_m, track.seen_s = pose.position_m, now_s
        return True

    def _reject(self, reason: str) -> bool:
        """Count a pose that is not accepted; return False."""
        self._counters[reason] += 1
        return False

    def _check(self, pose: PoseInput, track: Track | None, now_s: float) -> str | None:
        position = pose.position_m
        if position is not None and (len(position) != 3 or not all(map(math.isfinite, position))):
            return "malformed pose"
        if not (math.isfinite(pose.yaw_rad or 0.0) and 0 <= pose.latency_s < math.inf):
            return "malformed pose"
        if track is None or pose.epoch > track.epoch:
            return None
        if pose.epoch == track.epoch and pose.frame > track.frame:
            return None
        # After a silence any epoch is a new beginning: one wild number must not blind us for ever.
        if now_s > track.arrived_s + FORGET_AFTER_S:
            return None
        return "old pose frame" if pose.epoch == track.epoch else "pose of an older epoch"

    def _is_stuck(self, track: Track, position: Position, airborne: bool) -> bool:
        _, _, height_m = position
        if not airborne:
            self._stood_at_m = height_m
        if self._limits.trust_repeated_poses or position != track.position_m:
            return False
        return self._stood_at_m is None or height_m > self._stood_at_m + LIFTED_M

    def _is_jump(self, track: Track, position: Position, now_s: float) -> bool:
        limits = self._limits
        if limits.maximum_jump_m is None or track.position_m is None:
            return False
        # The motion capture does not confuse a body that it saw all the time.
        followed_s = 0.0 if track.occluded else track.undelivered_s
        unseen_s = max(now_s - track.seen_s, followed_s)
        moving_s = min(unseen_s, max(LONGEST_EXTRAPOLATION_S, followed_s))
        (x, y, z), (vx, vy, vz) = track.position_m, track.velocity_m_s
        x, y, z = x + vx * moving_s, y + vy * moving_s, z + vz * moving_s
        fastest_m_s = limits.maximum_speed_m_s
        braked_m = max(fastest_m_s * LONGEST_EXTRAPOLATION_S, LARGEST_M_S2 / 2 * moving_s**2)
        reach = limits.maximum_jump_m + min(fastest_m_s * moving_s, braked_m)
        if unseen_s > moving_s:
            drift_s = min(unseen_s - moving_s, LONGEST_DRIFT_S)
            # Wherever it is between there and as far as it may have sunk.
            z = min(max(position[2], z - SINK_M_S2 / 2 * drift_s**2), z)
            reach += DRIFT_M_S * drift_s
        return math.dist((x, y, z), position) > reach

    def _note_jump(self, waited_s: float) -> None:
        """Distrust poses that stay somewhere else; a silence, as of a busy computer, does not count."""
        before_s = self._jumping_s
        self._jumping_s = 0.0 if before_s is None else before_s + min(waited_s, LONGEST_EXTRAPOLATION_S)
        if self._jumping_s >= self._limits.jump_descend_s:
            self._mistaken = "own pose jumped and did not come back"

    def _turn(self, track: Track, pose: PoseInput, now_s: float, *, airborne: bool) -> None:
        """Follow the heading; keep the last one while it has jumped, as with exchanged markers."""
        if airborne and track.yaw_rad is not None and pose.yaw_rad is not None:
            since_s = now_s - (track.seen_s if track.turned_s is None else track.turned_s)
            turned_rad = abs(math.remainder(pose.yaw_rad - track.yaw_rad, math.tau))
            if turned_rad > JUMP_RAD + FASTEST_RAD_S * min(since_s, LONGEST_EXTRAPOLATION_S):
                track.turned_s = now_s if track.turned_s is None else track.turned_s
                return
        track.yaw_rad, track.turned_s = pose.yaw_rad, None

    def _follow(
        self, track: Track, pose: PoseInput, position: Position, now_s: float, *, moving: bool
    ) -> None:
        """Filter the velocity up to a believed pose."""
        last = track.position_m
        if last is None or not moving:
            track.velocity_m_s = (0.0, 0.0, 0.0)
        else:
            captured_s = _captured_since_s(pose, track.seen_epoch, track.seen_frame)
            elapsed = max(now_s - track.seen_s if captured_s is None else captured_s, SHORTEST_STEP_S)
            weight = -math.expm1(-elapsed / self._limits.velocity_filter_s)
            (x, y, z), (last_x, last_y, last_z), (vx, vy, vz) = position, last, track.velocity_m_s
            track.velocity_m_s = (
                vx + weight * ((x - last_x) / elapsed - vx),
                vy + weight * ((y - last_y) / elapsed - vy),
                vz + weight * ((z - last_z) / elapsed - vz),
            )
        track.seen_frame, track.seen_epoch = pose.frame, pose.epoch
        track.captured_s = now_s - pose.latency_s

    def release(self) -> None:
        """Forget that the vehicle may have been mistaken for another; it is not flying."""
        self._jumping_s = None
        self._mistaken = None

    def take_over(self, last: Track | None, distrust: str | None, now_s: float) -> None:
        """Begin with a vehicle in flight, floor unknown, and with the poses that an earlier process believed.

        The newest pose is judged again as their continuation: it may be of another body by now. `distrust`
        rejects own poses until the vehicle has landed.
        """
        self._stood_at_m = None
        self._mistaken = distrust
        if last is not None:
            self.own_track = copy(last)
            if self.newest is not None:
                self.own_pose(self.newest, now_s, airborne=True)

    @property
    def believed(self) -> Track | None:
        """Copy of the own track, with which a successor begins; None before a position was believed."""
        track = self.own_track
        return None if track is None or track.position_m is None else copy(track)

    @property
    def mistaken(self) -> bool:
        """Whether the own poses may be those of another body until the vehicle has landed, or turned."""
        turned = self.own_track is not None and self.own_track.turned_s is not None
        return turned or self._mistaken is not None

    def floor_m(self, otherwise_m: float) -> float:
        """Height at which the vehicle stood before take-off; `otherwise_m` if that was not seen."""
        stood_at_m = self._stood_at_m
        return otherwise_m if stood_at_m is None or stood_at_m > otherwise_m + STANDING_M else stood_at_m

    def height_m(self, floor_m: float) -> float:
        """Height above a floor at which the vehicle was seen last; 0 if it never was."""
        track = self.own_track
        return 0.0 if track is None or track.position_m is None else track.position_m[2] - floor_m

    def own_motion(self, now_s: float, longest_age_s: float) -> Motion | None:
        """How the own vehicle moves; None when its newest believed pose is too old or may be another's."""
        track = self.own_track
        if track is None or track.position_m is None or track.yaw_rad is None:
            return None
        if self._mistaken is not None or now_s >= track.captured_s + longest_age_s:
            return None
        clear = self._clear_place(track.position_m)
        return Motion(track.position_m, track.velocity_m_s, track.yaw_rad, clear)

    def judge(self, now_s: float, thrust_time_s: float) -> Judgement:
        """Judge the newest poses at `now_s`; `thrust_time_s` is the time with thrust since arming [s]."""
        own = self.own_track
        hold, lost = self._lost(own, now_s)
        descend = self._mistaken or lost
        if own is not None and own.position_m is not None:
            if self._limits.fence is not None:
                fence_hold, fence_descend = judge_fence(self._limits.fence, own.position_m, own.velocity_m_s)
                hold, descend = hold or fence_hold, descend or fence_descend
            too_close = self._too_close(own.position_m, now_s)
            hold = hold or too_close
            if own.turned_s is not None:
                hold = hold or "own heading jumped"
                if now_s >= own.turned_s + self._limits.jump_descend_s:
                    descend = descend or "own heading jumped and did not come back"
        limit = self._limits.maximum_thrust_s
        if limit is not None and thrust_time_s >= limit:
            descend = descend or f"thrust for {limit:g} s, the longest allowed"
        return Judgement(hold, descend)

    def _lost(self, own: Track | None, now_s: float) -> tuple[str | None, str | None]:
        seen_s = -math.inf if own is None else own.captured_s
        hold_s, descend_s = self._limits.tracking_hold_s, self._limits.tracking_descend_s
        if descend_s is not None and now_s >= seen_s + descend_s:
            return None, f"own pose lost for {descend_s:g} s"
        if hold_s is not None and now_s >= seen_s + hold_s:
            return f"own pose lost for {hold_s:g} s", None
        return None, None

    def _too_close(self, position: Position, now_s: float) -> str | None:
        minimum = self._limits.minimum_distance_m
        if minimum is None:
            return None
        apart = minimum + self._limits.distance_hysteresis_m
        close: list[str] = []
        for name, place in self.other_places(now_s).items():
            distance = math.dist(position, place)
            if distance < apart and (distance < minimum or name in self._close):
                close.append(name)
        self._close = close
        return f"{close[0]} closer than {minimum:g} m" if close else None

    def other_places(self, now_s: float) -> dict[str, Position]:
        """Places of the other vehicles that are seen."""
        return {
            name: track.position_m
            for name, track in self._others.items()
            if track.position_m is not None and now_s < track.seen_s + self._limits.other_pose_s
        }

    def _clear_place(self, position: Position) -> Position | None:
        """Place at this height that is clear of the vehicles that are too close; None if there are none."""
        minimum = self._limits.minimum_distance_m
        if minimum is None or not self._close:
            return None
        x, y, z = position
        clear_x, clear_y = x, y
        for name in self._close:
            if (other := self._others[name].position_m) is not None:
                away_x, away_y = x - other[0], y - other[1]
                distance = max(math.hypot(away_x, away_y), SMALLEST_DISTANCE_M)
                share = (minimum + CLEAR_M) / distance - 1.0
                clear_x, clear_y = clear_x + share * away_x, clear_y + share * away_y
        return (clear_x, clear_y, z)

    def next_event_s(self) -> list[float]:
        """Times at which the judgement may change without a new pose [s]."""
        own = self.own_track
        if own is None or own.position_m is None:
            return []
        hold_s, descend_s = self._limits.tracking_hold_s, self._limits.tracking_descend_s
        return [own.captured_s + limit for limit in (hold_s, descend_s) if limit is not None]


def _captured_since_s(pose: PoseInput, epoch: int, frame: int) -> float | None:
    """Time from the capture of a frame to that of a pose; None if unknown, or in another stream."""
    if pose.period_s is None or pose.epoch != epoch:
        return None
    return (pose.frame - frame) * pose.period_s


def judge_fence(fence: Fence, position: Position, velocity: Position) -> tuple[str | None, str | None]:
    """Reasons to HOLD and to DESCEND from the fence.

    A vehicle beyond the margin comes down. One that cannot stop inside any more is held, except when it
    climbs towards the ceiling: holding does not end a climb, so it comes down. Towards the floor there is no
    stopping test, it would forbid landing.
    """
    hold: str | None = None
    axes = zip("xyz", position, velocity, fence.lower_m, fence.upper_m, fence.braking_m_s2, strict=True)
    for name, p, v, lower, upper, braking in axes:
        way = v * v / (2 * braking)
        if not lower - fence.margin_m <= p <= upper + fence.margin_m:
            return None, f"outside the fence in {name}"
        if name == "z":
            if v > 0 and p + way > upper:
                return None, "cannot stop below the fence's ceiling"
        elif (v > 0 and p + way > upper) or (v < 0 and p - way < lower):
            hold = hold or f"cannot stop inside the fence in {name}"
    return hold, None
