"""Carries out what the table of succession says, period by period, for one follower."""

from collections import Counter
from collections.abc import Callable, Mapping

from agents.flight.guidance import LeaderPlan, Link
from agents.flight.phases import Phase
from agents.following.leaders import Leaders
from agents.following.links import following_at_rest, link_of
from agents.following.neighbours import Neighbours
from agents.formation.succession import (
    STANCES,
    Finding,
    Heir,
    Policy,
    Stance,
    link_to_successor,
    successor_of,
)
from agents.pilot import Pilot
from agents.settings import AgentSettings
from bus.messages import Following

LATE_AFTER_S = 0.1
"""Age of the newest plan from which it counts as ridden out."""


class LostLeaders:
    """Follows, rides out, holds, leads or lands, by what is heard of the leaders and by the fleet file.

    Parameters
    ----------
    settings, pilot, leaders, neighbours
        The agent's own.
    clock
        Monotonic clock [s].
    """

    def __init__(
        self,
        settings: AgentSettings,
        pilot: Pilot,
        leaders: Leaders,
        neighbours: Neighbours,
        clock: Callable[[], float],
    ) -> None:
        self.stance = Stance.FOLLOW
        self.events: Counter[str] = Counter()
        self._vehicle = settings.vehicle
        self._succession = settings.succession
        self._policy = Policy(settings.succession.policy)
        self._pilot = pilot
        self._leaders = leaders
        self._neighbours = neighbours
        self._clock = clock
        self._here_s: float | None = None
        self._assigned: tuple[Link, ...] = ()
        self._successor: str | None = None

    def expect(self) -> None:
        """Take the leaders for heard of just now: an agent that restarts goes on waiting for them."""
        self._assigned, self._here_s = self._pilot.guidance.assigned, self._clock()

    def tend(self, plans: Mapping[str, LeaderPlan]) -> bool:
        """Judge the leaders by their newest plans; True if other vehicles are followed from now on."""
        guidance = self._pilot.guidance
        if guidance.assigned is not self._assigned or guidance.phase is not Phase.FLYING:
            self._assigned, self._here_s = guidance.assigned, None
            self.stance, self._successor = Stance.FOLLOW, None
        if not guidance.assigned or guidance.phase is not Phase.FLYING:
            return False
        finding = self._finding(plans)
        heir, successor = Heir.NONE, None
        if finding is Finding.LOST and self._policy is Policy.PROMOTE:
            heir, successor = self._heir()
        stance = STANCES[finding, self._policy, heir]
        if (stance, successor) == (self.stance, self._successor):
            return False
        before = self.stance
        self.stance, self._successor = stance, successor
        if stance is not Stance.FOLLOW:
            self.events[f"leader_lost_{stance}"] += 1
        return self._take(stance, successor, before)

    def _finding(self, plans: Mapping[str, LeaderPlan]) -> Finding:
        now_s = self._clock()
        ahead = [
            plans[link.leader].ahead_s
            for link in self._assigned
            if link.leader in plans and plans[link.leader].followable
        ]
        if ahead and min(ahead) <= LATE_AFTER_S:
            self._here_s = now_s
            return Finding.HERE
        if ahead and min(ahead) + self._pilot.model.delay_s <= self._pilot.guidance.plan_limit_s:
            return Finding.LATE
        if self._here_s is None or now_s - self._here_s <= self._succession.after_s:
            return Finding.GONE
        return Finding.LOST

    def _links(self) -> dict[str, tuple[Following, ...]]:
        links = {name: status.assigned for name, status in self._neighbours.statuses().items()}
        own = tuple(map(following_at_rest, self._assigned))
        return {**links, self._vehicle: own}

    def _heir(self) -> tuple[Heir, str | None]:
        lost = self._assigned[0].leader
        ready = {self._vehicle} | {
            name
            for name, status in self._neighbours.statuses().items()
            if status.phase == Phase.FLYING and name in self._succession.heirs
        }
        order = self._succession.orders.get(lost, ())
        name = successor_of(lost, self._links(), ready, order)
        if name is None:
            return Heir.NONE, None
        return (Heir.SELF if name == self._vehicle else Heir.OTHER), name

    def _take(self, stance: Stance, successor: str | None, before: Stance) -> bool:
        guidance = self._pilot.guidance
        if stance is Stance.LEAD:
            guidance.follow_instead(())
            return True
        if stance is Stance.FOLLOW_SUCCESSOR and successor is not None:
            lost = self._assigned[0].leader
            plan = self._leaders.newest(lost)
            yaw_rad = 0.0 if plan is None else float(plan.trajectory.to_numpy()[0, 3])
            link = link_to_successor(self._vehicle, successor, lost, self._links(), yaw_rad)
            if link is not None:
                guidance.follow_instead((link_of(link),))
            return True
        if stance is Stance.LAND:
            guidance.land(self._pilot.estimate, self._pilot.clock.time_s)
            return False
        if before in (Stance.LEAD, Stance.FOLLOW_SUCCESSOR):
            guidance.rejoin()
            return True
        return False
