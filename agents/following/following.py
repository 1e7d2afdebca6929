"""Leaders and neighbours of one vehicle: their plans and statuses, changes of leaders, lost leaders."""

from collections.abc import Mapping
from functools import partial
from typing import Final

from rcopterx.agents.following.leader_changes import LeaderChanges
from rcopterx.agents.following.leader_plans import LeaderPlans, PeerStatuses
from rcopterx.agents.following.lost_leaders import LostLeaders
from rcopterx.agents.following.traffic import Traffic
from rcopterx.agents.pilot import Pilot
from rcopterx.agents.separation.avoidance import NeighbourPlan
from rcopterx.agents.settings import AgentSettings
from rcopterx.bus import channels
from rcopterx.bus.messages import AgentStatus, Diagnostics
from rcopterx.bus.stepping import StepBus
from rcopterx.formation.law import LeaderPlan

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
        self.changes = LeaderChanges(
            vehicle, settings.vehicles, settings.room, pilot, self.plans, self.peers, bus.clock
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
