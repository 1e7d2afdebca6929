"""Leaders and neighbours of one vehicle: their plans and statuses, changes of leaders, lost leaders."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

from rcopterx.agents.flight.guidance import PLAN_LIMIT_S
from rcopterx.agents.following.leader_changes import LeaderChanges
from rcopterx.agents.following.leader_plans import LeaderPlans, PeerStatuses, followed_leader, target_link
from rcopterx.agents.following.traffic import Traffic
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.separation.avoidance import NeighbourPlan
from rcopterx.agents.settings import AgentSettings
from rcopterx.bus import channels
from rcopterx.bus.messages import AgentStatus, Diagnostics, LeaderLink
from rcopterx.bus.stepping import StepBus
from rcopterx.formation.law import FollowedLeader, LeaderPlan
from rcopterx.formation.placement import PresentRoom, entered
from rcopterx.formation.succession import (
    Finding,
    FollowingMode,
    Policy,
    Succession,
    following_mode,
    link_to_successor,
    successor_of,
)
from rcopterx.vehicles.phases import Phase

LATE_AFTER_S = 0.1  # age from which the newest plan counts as the last one


@dataclass
class LostLeaders:
    """Follows, uses the last plan, holds, leads or lands, by the plans of the leaders and the fleet file."""

    vehicle: str
    succession: Succession
    pilot: Pilot
    plans: LeaderPlans
    peers: PeerStatuses
    clock: Callable[[], float]

    def __post_init__(self) -> None:
        self.following_mode = FollowingMode.FOLLOW
        self._events = self.pilot.events
        self._here_s: float | None = None
        self._assigned: tuple[FollowedLeader, ...] = ()
        self._successor: str | None = None

    def expect(self) -> None:
        """Assume that the leaders are here now: an agent that restarts waits for them again."""
        self._assigned, self._here_s = self.pilot.guidance.task.assigned, self.clock()

    def update(self, plans: Mapping[str, LeaderPlan]) -> bool:
        """Update the following mode by the leaders' newest plans; return whether the leaders change."""
        guidance = self.pilot.guidance
        if guidance.task.assigned is not self._assigned or guidance.task.phase is not Phase.FLYING:
            self._assigned, self._here_s = guidance.task.assigned, None
            self.following_mode, self._successor = FollowingMode.FOLLOW, None
        if not guidance.task.assigned or guidance.task.phase is not Phase.FLYING:
            return False
        finding = self._finding(plans)
        policy, successor = self.succession.policy, None
        if finding is Finding.LOST and policy == Policy.PROMOTE:
            successor = self._find_successor()
        mode = following_mode(finding, policy, self.vehicle, successor)
        if (mode, successor) == (self.following_mode, self._successor):
            return False
        before = self.following_mode
        self.following_mode, self._successor = mode, successor
        if mode is not FollowingMode.FOLLOW:
            self._events[f"leader_lost_{mode}"] += 1
        return self._take(mode, successor, before)

    def _finding(self, plans: Mapping[str, LeaderPlan]) -> Finding:
        now_s, ahead_s = self.clock(), math.inf
        for link in self._assigned:
            plan = plans.get(link.leader)
            if plan is not None and plan.followable:
                ahead_s = min(ahead_s, plan.ahead_s)
        if ahead_s <= LATE_AFTER_S:
            self._here_s = now_s
            return Finding.HERE
        if ahead_s + self.pilot.model.delay_s <= PLAN_LIMIT_S:
            return Finding.LATE
        if self._here_s is None or now_s - self._here_s <= self.succession.after_s:
            return Finding.GONE
        return Finding.LOST

    def _links(self) -> dict[str, tuple[LeaderLink, ...]]:
        links = {name: status.assigned for name, status in self.peers.statuses().items()}
        return {**links, self.vehicle: tuple(map(target_link, self._assigned))}

    def _find_successor(self) -> str | None:
        lost = self._assigned[0].leader
        ready = {self.vehicle} | {
            name
            for name, status in self.peers.statuses().items()
            if status.phase == Phase.FLYING and name in self.succession.promotable
        }
        return successor_of(lost, self._links(), ready, self.succession.orders.get(lost, ()))

    def _take(self, mode: FollowingMode, successor: str | None, before: FollowingMode) -> bool:
        guidance = self.pilot.guidance
        if mode is FollowingMode.LEAD:
            guidance.follow_instead(())
            return True
        if mode is FollowingMode.FOLLOW_SUCCESSOR and successor is not None:
            lost = self._assigned[0].leader
            plan = self.plans.newest(lost)
            yaw_rad = 0.0 if plan is None else float(plan.trajectory.to_numpy()[0, 3])
            link = link_to_successor(self.vehicle, successor, lost, self._links(), yaw_rad)
            if link is not None:
                guidance.follow_instead((followed_leader(link),))
            return True
        if mode is FollowingMode.LAND:
            guidance.land(self.pilot.estimate, self.pilot.clock.time_s)
            return False
        if before in (FollowingMode.LEAD, FollowingMode.FOLLOW_SUCCESSOR):
            guidance.follow_instead(guidance.task.assigned)
            return True
        return False


LARGEST_WAITING_SHARE: Final = 0.5  # of a control period that a follower far down the line waits for plans


class Following:
    """What one agent receives from others, and what its leaders are."""

    def __init__(self, settings: AgentSettings, pilot: Pilot, bus: StepBus) -> None:
        vehicle = settings.vehicle
        self._settings, self._pilot = settings, pilot
        # Late plans count in the next period.
        self.plans: LeaderPlans = LeaderPlans(
            vehicle, partial(bus.subscribe, channels.PLAN, waking=lambda: self.plans.awaited)
        )
        self.plans.subscribe_to(link.leader for link in settings.following)
        statuses = bus.subscribe_all(channels.AGENT_STATUS, waking=False)
        self.peers = PeerStatuses(vehicle, statuses, bus.clock)
        neighbours = partial(bus.subscribe, channels.PLAN, waking=False)
        self.traffic = Traffic(vehicle, settings.separation, neighbours)
        self.room = PresentRoom(settings.room)
        self.changes = LeaderChanges(
            vehicle, settings.vehicles, self.room, pilot, self.plans, self.peers, bus.clock
        )
        self.lost = LostLeaders(vehicle, settings.succession, pilot, self.plans, self.peers, bus.clock)

    def resume(self) -> None:
        """Wait for the leaders of a predecessor, whose task the pilot continues."""
        self.changes.update_subscriptions()
        self.lost.expect()

    def longest_wait_s(self) -> float:
        """Return how long a period may wait for plans: every leader above this vehicle needs its time."""
        guidance, settings = self._pilot.guidance, self._settings
        level = self.plans.level(guidance.awaited) if guidance.follows else 0
        return min(level * settings.leader_wait_s, LARGEST_WAITING_SHARE * settings.period_s)

    def for_control(self) -> tuple[Mapping[str, LeaderPlan], Mapping[str, NeighbourPlan]]:
        """Return the plans of leaders and of neighbours for a control period; lost leaders are replaced."""
        clock = self._pilot.clock
        plans = self.plans.plans(clock, self.changes.cycles_from)
        if self.lost.update(plans):
            self.changes.update_subscriptions()
        return plans, self.traffic.neighbours(clock, plans)

    def after_control(self, status: AgentStatus | None) -> None:
        """Subscribe to the plans of vehicles that could come near, by the own status, if it is time."""
        if status is not None and self.traffic.due():
            self.traffic.update(status, self.peers.statuses())

    def report(self, to: Diagnostics, now_s: float) -> None:
        """See `rcopterx.agents.reporting.Reports`."""
        to.plan_age_s = self.plans.plan_age_s(now_s, self._pilot.guidance.leaders)
        to.rejected |= {**self.plans.rejected, **self.traffic.rejected}
        if (reference := self._pilot.reference) is not None:
            zones, place_m = self.room.now.zones.items(), reference[None, :3]
            to.remarks += tuple(
                f"in the zone {name}" for name, zone in zones if entered(zone, place_m) is not None
            )
