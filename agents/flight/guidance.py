"""Phase and task of a vehicle: requests change them, and a reference over the horizon follows from them."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rcopterx.agents.flight.lift_off import Touchdown
from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.columns import COLUMNS, POSE, POSITION, RATES
from rcopterx.control.references.paths import PEAK_TO_MEAN_SPEED, FlightPath
from rcopterx.control.references.set_points import (
    PathReference,
    ProfileLimits,
    ReferenceSource,
    SetPointReference,
    SuspendedPath,
    TimedPath,
    descent,
    smooth_move,
    smooth_way,
    transition_through,
)
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.formation.law import FollowedLeader, LeaderPlan, References, offset_between, references_beside
from rcopterx.vehicles.phases import AIRBORNE, Effect, Event, Phase, transition
from rcopterx.vehicles.state import YAW, Array, inertial_rates


@dataclass(slots=True)
class Task:
    """What a vehicle has to do, and how far it is; a successor of its agent continues there."""

    phase: Phase = Phase.GROUND
    source: ReferenceSource = field(default_factory=lambda: SetPointReference(np.zeros(3), 0.0))
    """Own reference: a set point, a move or a path, and when it began."""
    followed: tuple[FollowedLeader, ...] = ()  # leaders followed now, with transitions of their offsets
    assigned: tuple[FollowedLeader, ...] = ()  # leaders by fleet file or request; replaced while lost
    joined: frozenset[str] = frozenset()  # leaders whose offsets began to move from the vehicle's own place
    floor_m: float = 0.0  # height of the floor below the vehicle when it took off
    interrupted: Phase | None = None  # take-off or landing that the gateway has interrupted
    climb_end_m: Array = field(default_factory=lambda: np.zeros(3))  # where its last take-off ends
    home_m: tuple[float, float] | None = None  # where it stood when it took off, x and y; None before


TAKE_OFF_SPEED_M_S = 0.6
CLIMBING_S = 0.4  # time of its climb at which a vehicle that has lifted begins: it moves already
OFFSET_SPEED_M_S = 0.5
SHORTEST_TRANSITION_S = 0.5  # shortest transition of an offset, unless a request says otherwise
PLAN_LIMIT_S = 0.5  # a plan of a leader that is older is not followed; the vehicle holds its place
RESTORED_PATIENCE_S = 0.3  # after a restart, transitions of offsets go on for so long without a leader's plan


class Guidance:
    """Phase and task of one vehicle.

    A follower copies `deviation_share` of its leaders' deviations from their nominal references.
    """

    def __init__(self, links: Sequence[FollowedLeader] = (), deviation_share: float = 0.25) -> None:
        self.task = Task(followed=tuple(links), assigned=tuple(links))
        self.rotor_on = False  # whether the vehicle is to be flown by the controller
        self.followable = False  # whether followers may use its plan: not while it takes off or lands
        self.events: Counter[str] = Counter()
        self.deviation_share = deviation_share
        self.coordinated = False
        """Whether a scheme places the vehicle beside its leaders; its own reference is then kept."""
        self.remark = ""  # task given up because the transmitter gateway took over; until the next request
        self._touchdown = Touchdown()
        self._restored_at_s = -math.inf

    @property
    def phase(self) -> Phase:
        """Present phase."""
        return self.task.phase

    @property
    def follows(self) -> bool:
        """Whether the reference comes from leaders now."""
        return bool(self.task.followed) and self.task.phase in (Phase.FLYING, Phase.EMERGENCY)

    @property
    def leaders(self) -> list[str]:
        """Names of the leaders followed now."""
        return [link.leader for link in self.task.followed]

    @property
    def awaited(self) -> list[str]:
        """Leaders whose plans the reference needs; a scheme has messages of its own."""
        return [] if self.coordinated else self.leaders

    def on_event(self, event: Event, estimate: Estimate, time_s: float) -> None:
        """Process an event, which may change the phase, and with it the task."""
        task, before = self.task, self.task.phase
        row = transition(before, event)
        if row is None:
            return
        interrupted, task.phase, task.interrupted = task.interrupted, row.target, None
        self.rotor_on, self.followable = row.target in AIRBORNE, row.target is Phase.FLYING
        if self.followable:
            task.joined = frozenset()
        if row.effect is Effect.INTERRUPT and before is not Phase.FLYING:
            task.interrupted = before
        elif row.effect is Effect.HOLD:
            self.hold_here(estimate)
        elif row.effect is Effect.CONTINUE:
            self._continue(interrupted, estimate, time_s)

    def _continue(self, interrupted: Phase | None, estimate: Estimate, time_s: float) -> None:
        """Continue a landing, a take-off, or the way to a set point."""
        if interrupted is Phase.LANDING:
            self.land(estimate, time_s)
        elif interrupted is Phase.TAKEOFF:
            self._climb_to(self.task.climb_end_m, estimate, time_s)
            self.on_event(Event.TAKE_OFF, estimate, time_s)
        elif self.task.followed:
            self.hold_here(estimate)
        else:
            self._continue_to(self.task.source, estimate, time_s)

    def _continue_to(self, source: ReferenceSource, estimate: Estimate, time_s: float) -> None:
        """Continue to the end of a reference, but give up an unfinished trajectory, whose time has passed."""
        if isinstance(source, PathReference) and not source.finished(time_s):
            self.events["trajectory_given_up"] += 1
            self.remark = "the transmitter gateway took over: the rest of the trajectory is given up"
            self.hold_here(estimate)
        elif not isinstance(source, SuspendedPath):
            self.task.source = SetPointReference(*source.end())

    def set_point(self) -> tuple[Array, float]:
        """Return position [m], shape (3,), and yaw [rad] at which the own reference ends."""
        return self.task.source.end()

    def hold_here(self, estimate: Estimate) -> None:
        """Make the present place the set point."""
        self.task.source = SetPointReference(estimate.motion[:3].copy(), float(estimate.motion[YAW]))

    def takes_off_to(self, height_m: float) -> bool:
        """Whether the vehicle takes off to this height above its floor now."""
        end_m = self.task.floor_m + height_m
        return self.phase is Phase.TAKEOFF and math.isclose(self.task.climb_end_m[2], end_m, abs_tol=1e-6)

    def take_off_problem(self) -> str | None:
        """Return why the vehicle cannot take off now; None if it can."""
        if self.phase is Phase.ARMED:
            return None
        return f"take-off needs an armed vehicle on the floor, the phase is {self.phase}"

    def take_off(self, estimate: Estimate, height_m: float, time_s: float) -> str | None:
        """Begin to climb at `time_s`; a refusal is returned as its reason."""
        problem = self.take_off_problem()
        if problem is not None:
            return problem
        start = estimate.motion[:3].copy()
        self.task.floor_m, self.task.home_m = float(start[2]), (float(start[0]), float(start[1]))
        self._climb_to(start + np.array([0.0, 0.0, height_m]), estimate, time_s)
        self.on_event(Event.TAKE_OFF, estimate, time_s)
        return None

    def lifted(self, estimate: Estimate, time_s: float) -> None:
        """Begin the climb: the vehicle has left the floor."""
        position_m, _ = self.set_point()
        self._climb_to(position_m, estimate, time_s - CLIMBING_S)

    def _climb_to(self, end_m: Array, estimate: Estimate, time_s: float) -> None:
        """Make the vertical line up to a place the reference."""
        self.task.climb_end_m = end_m
        start_m = np.append(end_m[:2], estimate.motion[2])
        self.task.source = smooth_move(
            start_m, end_m, float(estimate.motion[YAW]), time_s, TAKE_OFF_SPEED_M_S
        )

    def land(self, estimate: Estimate, time_s: float) -> str | None:
        """Begin to descend; a refusal is returned as its reason."""
        if self.phase not in AIRBORNE:
            return f"nothing to land, the phase is {self.phase}"
        if self.phase is Phase.LANDING:
            return None
        place_m, yaw_rad = estimate.motion[:3].copy(), float(estimate.motion[YAW])
        self.task.source = descent(place_m, self.task.floor_m, yaw_rad, time_s)
        self._touchdown.begin(self.task.floor_m)
        self.on_event(Event.LAND, estimate, time_s)
        return None

    def way_to(
        self, position_m: Array, yaw_rad: float, time_s: float = 0.0, limits: ProfileLimits | None = None
    ) -> ReferenceSource:
        """Return a smooth way to a set point within limits that followers impose; without them it steps."""
        if limits is None:
            return SetPointReference(position_m, yaw_rad)
        return smooth_way(limits, position_m, yaw_rad, self.task.source, time_s)

    def go_to(self, source: ReferenceSource) -> str | None:
        """Fly to a set point; a refusal is returned as its reason."""
        problem = self.flight_problem()
        if problem is None:
            self.remark, self.task.source = "", source
        return problem

    def heading_rad(self, time_s: float) -> float:
        """Return the heading of the own reference now, with all turns."""
        return float(self.task.source.sample(time_s, 1.0, 1).yaw_rad[0])

    def flight_problem(self) -> str | None:
        """Return why no set point or path is accepted now; None if one is."""
        if self.phase is not Phase.FLYING:
            return f"set points and trajectories are for flying vehicles, the phase is {self.phase}"
        if self.task.followed:
            leaders = ", ".join(link.leader for link in self.task.followed)
            return f"it follows {leaders}; ask the leader, or let this vehicle lead first"
        return None

    def fly(self, path: FlightPath, time_s: float) -> None:
        """Fly a path from now on."""
        self.remark = ""
        self.task.source = PathReference(path, time_s)

    @property
    def suspended(self) -> bool:
        """Whether a path waits to be resumed; every other reference discards it."""
        return isinstance(self.task.source, SuspendedPath)

    def suspend(self, estimate: Estimate, time_s: float, at_s: float) -> str:
        """Bring the vehicle to rest on its path, which is left from `at_s` on; return that in words."""
        source = self.task.source
        if not self.suspended:
            path = source if isinstance(source, TimedPath) else self._way_to(*source.end(), estimate, time_s)
            self.task.source = path.suspended(time_s, at_s) or source
        return "suspended" if self.suspended else "holds its place, or is about to"

    def _way_to(self, end_m: Array, yaw_rad: float, estimate: Estimate, time_s: float) -> TimedPath:
        """Return a smooth way from the present motion to a set point."""
        begin, end = np.zeros((2, COLUMNS))
        begin[POSE], end[POSE] = estimate.motion[:4], (*end_m, yaw_rad)
        begin[RATES] = inertial_rates(estimate.motion)
        duration_s = PEAK_TO_MEAN_SPEED * float(np.linalg.norm(end_m - begin[POSITION])) / OFFSET_SPEED_M_S
        return transition_through(time_s, (0.0, begin), (max(duration_s, SHORTEST_TRANSITION_S), end))

    def resume(self, time_s: float, at_s: float) -> str | None:
        """Go on with the suspended path from `at_s` on; a refusal is returned as its reason."""
        source = self.task.source
        if not isinstance(source, SuspendedPath):
            return "nothing is suspended"
        if not source.finished(time_s):
            return "it still comes to rest"
        self.task.source = source.kind(source.rest, at_s)
        return None

    def path_left_s(self, time_s: float) -> float:
        """Time until the present path ends, a suspended one after it is resumed; 0 without one."""
        source = self.task.source
        if isinstance(source, SuspendedPath) and source.kind is PathReference:
            return source.rest.duration_s
        if not isinstance(source, PathReference):
            return 0.0
        return max(0.0, source.start_s + source.path.duration_s - time_s)

    def lead(self, estimate: Estimate) -> None:
        """Follow no leader; a flying vehicle holds its place."""
        self.task.assigned = ()
        self.task.followed = ()
        if self.phase is Phase.FLYING:
            self.hold_here(estimate)

    def follow(
        self,
        links: Sequence[FollowedLeader],
        plans: Mapping[str, LeaderPlan],
        estimate: Estimate,
        time_s: float,
        transition_s: float | None,
    ) -> None:
        """Follow leaders from now on; the offsets move from the present place to their targets."""
        self.task.assigned = tuple(links)
        self.task.followed = self.task.assigned
        if self.phase is Phase.FLYING:
            self._begin_transitions(plans, estimate, time_s, transition_s)

    def follow_instead(self, links: Sequence[FollowedLeader]) -> None:
        """Follow others, or none and hold the place, while the assigned leaders are lost, or these again."""
        self.task.followed = tuple(links)
        self.task.joined = frozenset()

    def restore(self, task: Task, estimate: Estimate, time_s: float) -> None:
        """Continue the task of a predecessor; this vehicle has just been found in the air."""
        own = self.task
        own.assigned, own.joined, own.followed = task.assigned, task.joined, task.followed
        if task.phase not in AIRBORNE:
            return
        own.floor_m, own.home_m, self._restored_at_s = task.floor_m, task.home_m, time_s
        unfinished = task.interrupted or task.phase
        if unfinished is Phase.LANDING:
            self.land(estimate, time_s)
        if own.phase is not Phase.LANDING or isinstance(task.source, TimedPath):
            own.source = task.source
        if unfinished is Phase.TAKEOFF:
            # As a climb, not as a path, so that it resumes after an interruption by the gateway.
            own.climb_end_m, _ = self.set_point()
            self.on_event(Event.TAKE_OFF, estimate, time_s)

    def _begin_transitions(
        self, plans: Mapping[str, LeaderPlan], estimate: Estimate, time_s: float, transition_s: float | None
    ) -> None:
        begun = []
        for link in self.task.followed:
            plan = plans.get(link.leader)
            if plan is None:
                begun.append(link)
                continue
            leader = plan.partly_undisturbed(self.deviation_share)
            now = leader.resampled(plan.ahead_s, leader.period_s, 1)
            start = offset_between(now, estimate, link.target)
            distance_m = float(np.linalg.norm(start.position_m - link.target.position_m))
            duration_s = max(SHORTEST_TRANSITION_S, PEAK_TO_MEAN_SPEED * distance_m / OFFSET_SPEED_M_S)
            duration_s = duration_s if transition_s is None else transition_s
            begun.append(replace(link, start=start, start_s=time_s, duration_s=duration_s))
        self.task.followed = tuple(begun)
        self.task.joined = frozenset(link.leader for link in begun if link.leader in plans)

    def references(
        self,
        plans: Mapping[str, LeaderPlan],
        estimate: Estimate,
        time_s: float,
        delay_s: float,
        period_s: float,
        stages: int,
    ) -> References:
        """Return the references: `stages` stages from `time_s + delay_s` on."""
        if self.phase is Phase.TAKEOFF and self.task.source.finished(time_s):
            self.on_event(Event.CLIMBED, estimate, time_s)
        if self.follows and not self.coordinated:
            usable = self._usable_plans(plans, estimate, time_s, delay_s)
            if usable:
                yaw_rad, share = float(estimate.motion[YAW]), self.deviation_share
                links = [link for link in self.task.followed if link.leader in usable]
                found = references_beside(links, usable, share, yaw_rad, time_s, delay_s, period_s, stages)
                first = found.flown.samples[0]
                self.task.source = SetPointReference(first[:3], float(first[YAW]))
                return found
        own = self.task.source.sample(time_s + delay_s, period_s, stages)
        return References(own, own)

    def _usable_plans(
        self, plans: Mapping[str, LeaderPlan], estimate: Estimate, time_s: float, delay_s: float
    ) -> dict[str, LeaderPlan]:
        """Return the plans of leaders that can be followed now; offsets to new ones begin to move."""
        usable: dict[str, LeaderPlan] = {}
        for link in self.task.followed:
            plan = plans.get(link.leader)
            if plan is not None and plan.followable and plan.ahead_s + delay_s <= PLAN_LIMIT_S:
                usable[link.leader] = plan
        if not usable:
            self.events["leader_plan_missing"] += 1
            if time_s - self._restored_at_s > RESTORED_PATIENCE_S:
                self.task.joined = frozenset()
        elif self.task.joined != usable.keys():
            self._begin_transitions(usable, estimate, time_s, None)
        return usable

    def check_floor(self, estimate: Estimate, time_s: float) -> None:
        """Leave the landing phase once the vehicle stands on the floor."""
        if self.phase is not Phase.LANDING:
            return
        reference_m = float(self.task.source.sample(time_s, 1.0, 1).position_m[0, 2])
        if self._touchdown.happened(estimate.motion, reference_m, time_s):
            self.on_event(Event.TOUCHED_DOWN, estimate, time_s)


def resting(estimate: Estimate, period_s: float, stages: int) -> Trajectory:
    """Plan of a vehicle that stands on the floor."""
    return SetPointReference(estimate.motion[:3].copy(), float(estimate.motion[YAW])).sample(
        0.0, period_s, stages
    )
