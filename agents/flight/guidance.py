"""Phase and task of a vehicle: requests change them, and a reference over the horizon follows from them."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rcopterx.agents.flight.lift_off import Touchdown
from rcopterx.agents.flight.task import Task
from rcopterx.control.interfaces import Estimate
from rcopterx.control.references.landing_descent import descent
from rcopterx.control.references.paths import FlightPath
from rcopterx.control.references.quintic import PEAK_TO_MEAN_SPEED
from rcopterx.control.references.set_points import (
    PathReference,
    ProfileLimits,
    ReferenceSource,
    SetPointReference,
    TimedPath,
    smooth_move,
    smooth_way,
)
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.formation.law import (
    FollowedLeader,
    LeaderPlan,
    References,
    offset_between,
    references_beside,
)
from rcopterx.vehicles.phases import AIRBORNE, Event, Phase, next_phase
from rcopterx.vehicles.state import YAW, Array

TAKE_OFF_SPEED_M_S = 0.6
OFFSET_SPEED_M_S = 0.5
SHORTEST_TRANSITION_S = 0.5  # shortest transition of an offset, unless a request says otherwise
PLAN_LIMIT_S = 0.5  # a plan of a leader that is older is not followed; the vehicle holds its place
RESTORED_PATIENCE_S = 0.3  # after a restart, transitions of offsets go on for so long without a leader's plan


class Guidance:
    """Phase and task of one vehicle.

    A follower copies `deviation_share` of its leaders' deviations from their nominal references.
    """

    def __init__(self, links: Sequence[FollowedLeader] = (), deviation_share: float = 0.25) -> None:
        self.phase = Phase.GROUND
        self.rotor_on = False  # whether the vehicle is to be flown by the controller
        self.followable = False  # whether followers may use its plan: not while it takes off or lands
        self.followed = tuple(links)  # leaders followed now
        self.assigned = self.followed  # leaders by fleet file or request; replaced while they are lost
        self.source: ReferenceSource = SetPointReference(np.zeros(3), 0.0)
        self.events: Counter[str] = Counter()
        self.deviation_share = deviation_share
        self.coordinated = False
        """Whether a scheme places the vehicle beside its leaders; its own reference is then kept."""
        self._touchdown = Touchdown()
        self._restored_at_s = -math.inf
        self._interrupted: Phase | None = None
        self._held_from: ReferenceSource | None = None
        """Reference when the transmitter gateway took over; evaluated when it returns the vehicle."""
        self.remark = ""  # task given up because the transmitter gateway took over; until the next request
        self._climb_end_m: Array = np.zeros(3)
        self._joined: frozenset[str] = frozenset()  # leaders whose offsets began at the vehicle's own place

    @property
    def follows(self) -> bool:
        """Whether the reference comes from leaders now."""
        return bool(self.followed) and self.phase in (Phase.FLYING, Phase.EMERGENCY)

    @property
    def leaders(self) -> list[str]:
        """Names of the leaders followed now."""
        return [link.leader for link in self.followed]

    @property
    def awaited(self) -> list[str]:
        """Leaders whose plans the reference needs; a scheme has messages of its own."""
        return [] if self.coordinated else self.leaders

    def resume_interrupted(self, estimate: Estimate, time_s: float) -> None:
        """Resume what the transmitter gateway has interrupted, once that is over, but for a trajectory."""
        if self.phase is not Phase.FLYING:
            return
        held_from, self._held_from = self._held_from, None
        if held_from is not None:
            self._resume_to(held_from, time_s)
        if self._interrupted is None:
            return
        if self._interrupted is Phase.LANDING:
            self.land(estimate, time_s)
        else:
            self._climb_to(self._climb_end_m, estimate, time_s)
            self.on_event(Event.TAKE_OFF, estimate)

    def _resume_to(self, source: ReferenceSource, time_s: float) -> None:
        """Continue to the end of a reference, but give up an unfinished trajectory, whose time has passed."""
        if isinstance(source, PathReference) and not source.finished(time_s):
            self.events["trajectory_given_up"] += 1
            self.remark = "the transmitter gateway took over: the rest of the trajectory is given up"
            return
        self.source = SetPointReference(*source.end())

    def set_point(self) -> tuple[Array, float]:
        """Return position [m], shape (3,), and yaw [rad] at which the own reference ends."""
        return self.source.end()

    def on_event(self, event: Event, estimate: Estimate) -> None:
        """Process an event, which may change the phase."""
        before, phase = self.phase, next_phase(self.phase, event)
        if phase is before:
            return
        self.phase, self.rotor_on, self.followable = phase, phase in AIRBORNE, phase is Phase.FLYING
        if self.phase is not Phase.FLYING:
            under_way = self.phase is Phase.EMERGENCY and before in (Phase.TAKEOFF, Phase.LANDING)
            self._interrupted = before if under_way else None
        if event in (Event.RESUME, Event.ARM) and self.phase is Phase.FLYING:
            alone = before is Phase.EMERGENCY and self._interrupted is None and not self.followed
            self._held_from = self.source if alone else None
            self.hold_here(estimate)
        if self.phase is Phase.FLYING:
            self._joined = frozenset()

    def hold_here(self, estimate: Estimate) -> None:
        """Make the present place the set point."""
        self.source = SetPointReference(estimate.motion[:3].copy(), float(estimate.motion[YAW]))

    def takes_off_to(self, height_m: float) -> bool:
        """Whether the vehicle takes off to this height above its floor now."""
        end_m = self._touchdown.floor_m + height_m
        return self.phase is Phase.TAKEOFF and math.isclose(self._climb_end_m[2], end_m, abs_tol=1e-6)

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
        self._touchdown.floor_m = float(start[2])
        self._climb_to(start + np.array([0.0, 0.0, height_m]), estimate, time_s)
        self.on_event(Event.TAKE_OFF, estimate)
        return None

    def lifted(self, estimate: Estimate, time_s: float) -> None:
        """Begin the climb: the vehicle has left the floor."""
        position_m, _ = self.set_point()
        self._climb_to(position_m, estimate, time_s)

    def _climb_to(self, end_m: Array, estimate: Estimate, time_s: float) -> None:
        """Make the vertical line up to a place the reference."""
        self._climb_end_m = end_m
        start_m = np.append(end_m[:2], estimate.motion[2])
        self.source = smooth_move(start_m, end_m, float(estimate.motion[YAW]), time_s, TAKE_OFF_SPEED_M_S)

    def land(self, estimate: Estimate, time_s: float) -> str | None:
        """Begin to descend; a refusal is returned as its reason."""
        if self.phase not in AIRBORNE:
            return f"nothing to land, the phase is {self.phase}"
        if self.phase is Phase.LANDING:
            return None
        place_m, yaw_rad = estimate.motion[:3].copy(), float(estimate.motion[YAW])
        self.source = descent(place_m, self._touchdown.floor_m, yaw_rad, time_s)
        self._touchdown.begin()
        self.on_event(Event.LAND, estimate)
        return None

    def go_to(
        self, position_m: Array, yaw_rad: float, time_s: float = 0.0, limits: ProfileLimits | None = None
    ) -> str | None:
        """Fly to a set point, inertial frame; a refusal is returned as its reason.

        The reference goes there smoothly, within limits that followers impose; without them it steps.
        """
        problem = self.flight_problem()
        if problem is not None:
            return problem
        self.remark = ""
        if limits is None:
            self.source = SetPointReference(position_m, yaw_rad)
        else:
            self.source = smooth_way(limits, position_m, yaw_rad, self.source, time_s)
        return None

    def heading_rad(self, time_s: float) -> float:
        """Return the heading of the own reference now, with all turns."""
        return float(self.source.sample(time_s, 1.0, 1).yaw_rad[0])

    def flight_problem(self) -> str | None:
        """Return why no set point or path is accepted now; None if one is."""
        if self.phase is not Phase.FLYING:
            return f"set points and trajectories are for flying vehicles, the phase is {self.phase}"
        if self.followed:
            leaders = ", ".join(link.leader for link in self.followed)
            return f"it follows {leaders}; ask the leader, or let this vehicle lead first"
        return None

    def fly(self, path: FlightPath, time_s: float) -> None:
        """Fly a path from now on."""
        self.remark = ""
        self.source = PathReference(path, time_s)

    def path_left_s(self, time_s: float) -> float:
        """Time until the present path ends; 0 without one."""
        if not isinstance(self.source, PathReference):
            return 0.0
        return max(0.0, self.source.start_s + self.source.path.duration_s - time_s)

    def lead(self, estimate: Estimate) -> None:
        """Follow no leader; a flying vehicle holds its place."""
        self.assigned = ()
        self.followed = ()
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
        self.assigned = tuple(links)
        self.followed = self.assigned
        if self.phase is Phase.FLYING:
            self._begin_transitions(plans, estimate, time_s, transition_s)

    def follow_instead(self, links: Sequence[FollowedLeader]) -> None:
        """Follow others, or none and hold the place, while the assigned leaders are lost, or these again."""
        self.followed = tuple(links)
        self._joined = frozenset()

    def task(self) -> Task:
        """Return the task, for a successor."""
        return Task(
            self.phase,
            self.source,
            self.followed,
            self.assigned,
            self._joined,
            self._touchdown.floor_m,
            self._interrupted if self.phase is Phase.EMERGENCY else None,
        )

    def restore(self, task: Task, estimate: Estimate, time_s: float) -> None:
        """Continue the task of a predecessor; this vehicle has just been found in the air."""
        self.assigned = task.assigned
        self._joined = task.joined
        self.followed = task.followed
        if task.phase not in AIRBORNE:
            return
        self._touchdown.floor_m = task.floor_m
        self._restored_at_s = time_s
        unfinished = task.phase if task.interrupted is None else task.interrupted
        if unfinished is Phase.LANDING:
            self.land(estimate, time_s)
        if self.phase is not Phase.LANDING or isinstance(task.source, TimedPath):
            self.source = task.source
        if unfinished is Phase.TAKEOFF:
            # As a climb, not as a path, so that it resumes after an interruption by the gateway.
            self._climb_end_m, _ = self.set_point()
            self.on_event(Event.TAKE_OFF, estimate)

    def _begin_transitions(
        self, plans: Mapping[str, LeaderPlan], estimate: Estimate, time_s: float, transition_s: float | None
    ) -> None:
        begun = []
        for link in self.followed:
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
        self.followed = tuple(begun)
        self._joined = frozenset(link.leader for link in begun if link.leader in plans)

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
        if self.phase is Phase.TAKEOFF and self.source.finished(time_s):
            self.on_event(Event.CLIMBED, estimate)
        if self.follows and not self.coordinated:
            usable = self._usable_plans(plans, estimate, time_s, delay_s)
            if usable:
                yaw_rad, share = float(estimate.motion[YAW]), self.deviation_share
                links = [link for link in self.followed if link.leader in usable]
                found = references_beside(links, usable, share, yaw_rad, time_s, delay_s, period_s, stages)
                first = found.flown.samples[0]
                self.source = SetPointReference(first[:3], float(first[YAW]))
                return found
        own = self.source.sample(time_s + delay_s, period_s, stages)
        return References(own, own)

    def _usable_plans(
        self, plans: Mapping[str, LeaderPlan], estimate: Estimate, time_s: float, delay_s: float
    ) -> dict[str, LeaderPlan]:
        """Return the plans of leaders that can be followed now; offsets to new ones begin to move."""
        usable: dict[str, LeaderPlan] = {}
        for link in self.followed:
            plan = plans.get(link.leader)
            if plan is not None and plan.followable and plan.ahead_s + delay_s <= PLAN_LIMIT_S:
                usable[link.leader] = plan
        if not usable:
            self.events["leader_plan_missing"] += 1
            if time_s - self._restored_at_s > RESTORED_PATIENCE_S:
                self._joined = frozenset()
        elif self._joined != usable.keys():
            self._begin_transitions(usable, estimate, time_s, None)
        return usable

    def check_floor(self, estimate: Estimate, time_s: float) -> None:
        """Leave the landing phase once the vehicle stands on the floor."""
        if self.phase is not Phase.LANDING:
            return
        reference_m = float(self.source.sample(time_s, 1.0, 1).position_m[0, 2])
        if self._touchdown.happened(estimate.motion, reference_m, time_s):
            self.on_event(Event.TOUCHED_DOWN, estimate)


def resting(estimate: Estimate, period_s: float, stages: int) -> Trajectory:
    """Plan of a vehicle that stands on the floor."""
    return SetPointReference(estimate.motion[:3].copy(), float(estimate.motion[YAW])).sample(
        0.0, period_s, stages
    )
