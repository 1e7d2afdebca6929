"""Plans of vehicles that could come near, received only as long as they could; how far to keep from each.

The plans of all vehicles would cost each agent fifty wake-ups per second and vehicle. Statuses show which
vehicles could meet; their plans do not wake the agent.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from rcopterx.agents.flight.timeline import FleetClock
from rcopterx.agents.following.leader_plans import leader_plan
from rcopterx.agents.separation.avoidance import NeighbourPlan, SeparationEllipsoid
from rcopterx.bus.messages import AgentStatus, Plan
from rcopterx.bus.subscription import Inbox
from rcopterx.formation.law import LeaderPlan
from rcopterx.formation.topology import FormationGraph, ancestors, formation_of, places, roots
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import Array

FORMATION_SCALE: Final = 0.9  # fraction of the distance of two places in a formation that its vehicles keep


def ellipsoid_scale(
    ellipsoid: SeparationEllipsoid, links: FormationGraph, places: Mapping[str, Array], name: str, other: str
) -> float:
    """Return the scale, 0 to 1, of the ellipsoid that a vehicle keeps free of another one.

    It is 0 for followers, and at most `FORMATION_SCALE` of the distance of `places` in one formation.
    """
    if name in ancestors(links, other):
        return 0.0
    mates = set(roots(links, name)) & set(roots(links, other))
    if not mates or name not in places or other not in places:
        return 1.0
    return min(1.0, FORMATION_SCALE * float(ellipsoid.normalised(places[name][:3] - places[other][:3])))


UPDATE_EVERY_TICKS: Final = 10
AHEAD_S: Final = 1.2  # length of the ways that are compared: a horizon, and the time between two statuses
SPEED_M_S: Final = 1.3
SAMPLES: Final = 5
MEET: Final = 1.8  # ways that come no closer than this, in ellipsoids, do not meet
IN_PLACE_M: Final = 0.25  # distance from its place in formation below which a vehicle is in it
MOST: Final = 8  # number of plans received at the same time, those of the nearest vehicles
PATIENCE: Final = 5  # number of updates for which a subscription continues after it was needed last
OLDEST_S: Final = 0.5  # largest age of a plan that is used


class Traffic:
    """Other vehicles' plans, for separation; `subscribe` opens subscriptions that do not wake the loop."""

    def __init__(
        self, vehicle: str, ellipsoid: SeparationEllipsoid | None, subscribe: Callable[[str], Inbox[Plan]]
    ) -> None:
        self._vehicle = vehicle
        self._ellipsoid = ellipsoid
        self._subscribe = subscribe
        self._inboxes: dict[str, Inbox[Plan]] = {}
        self._scales: dict[str, float] = {}
        self._updates_left: dict[str, int] = {}
        self._ticks = 0
        self.most = MOST  # number of plans received at the same time; fewer while the computer cannot keep up
        self._rejected: Counter[str] = Counter()

    def due(self) -> bool:
        """Count a control period; return whether it is time for an `update`."""
        self._ticks += 1
        return self._ellipsoid is not None and self._ticks % UPDATE_EVERY_TICKS == 1

    def update(self, own: AgentStatus, others: Mapping[str, AgentStatus]) -> None:
        """Subscribe to the plans of the vehicles that could come near, by present statuses."""
        ellipsoid = self._ellipsoid
        if ellipsoid is None:
            return
        distances: dict[str, float] = {}
        if own.phase == Phase.FLYING and own.position_m is not None:
            links, heads = formation_of({**others, self._vehicle: own})
            where = places(links, heads)
            self._scales = {
                name: ellipsoid_scale(ellipsoid, links, where, self._vehicle, name) for name in others
            }
            own_way = way(own)
            for name, status in others.items():
                if status.position_m is None or not self._scales[name]:
                    continue
                if self._in_place(name, np.subtract(status.position_m, own.position_m), links, where):
                    continue
                distance = float(ellipsoid.normalised(own_way[:, None] - way(status)).min())
                if distance < MEET:
                    distances[name] = distance
        self._subscribe_to(sorted(distances, key=lambda name: distances[name])[: self.most])

    def _in_place(self, name: str, gap_m: Array, links: FormationGraph, where: Mapping[str, Array]) -> bool:
        """Return whether a vehicle of the same formation is near its place beside the own one."""
        mates = set(roots(links, name)) & set(roots(links, self._vehicle))
        if not mates or name not in where or self._vehicle not in where:
            return False
        return bool(np.linalg.norm(gap_m - (where[name] - where[self._vehicle])[:3]) < IN_PLACE_M)

    def _subscribe_to(self, wanted: list[str]) -> None:
        """Subscribe to these plans; others end `PATIENCE` updates after they were needed last."""
        for name in self._updates_left:
            self._updates_left[name] -= 1
        self._updates_left |= dict.fromkeys(wanted, PATIENCE)
        for name in wanted:
            if name not in self._inboxes:
                self._inboxes[name] = self._subscribe(name)
        for name in [name for name, left in self._updates_left.items() if left <= 0]:
            del self._updates_left[name]
            inbox = self._inboxes.pop(name)
            self._rejected.update(inbox.rejected)
            inbox.close()

    def neighbours(self, clock: FleetClock, plans: Mapping[str, LeaderPlan]) -> dict[str, NeighbourPlan]:
        """Return the vehicles whose plans are received, and the leaders, whose plans are known anyway."""
        if self._ellipsoid is None:
            return {}
        young = {name: plan for name, plan in plans.items() if plan.ahead_s < OLDEST_S}
        for name, inbox in self._inboxes.items():
            received = None if name in young else inbox.latest()
            if received is not None and received.message.epoch == clock.epoch:
                plan = leader_plan(received.message, clock, with_nominal=False)
                if plan.ahead_s < OLDEST_S:
                    young[name] = plan
        scales = self._scales
        return {name: NeighbourPlan(plan, scales[name]) for name, plan in young.items() if name in scales}

    @property
    def rejected(self) -> Mapping[str, int]:
        """Rejected plans by reason, those of closed subscriptions included."""
        total = Counter(self._rejected)
        for inbox in self._inboxes.values():
            total.update(inbox.rejected)
        return {f"neighbour_plan.{kind}": count for kind, count in total.items()}


def way(status: AgentStatus) -> Array:
    """Return places of a vehicle in the next second, shape (2 `SAMPLES`, 3), by its speed and set point."""
    here = np.array(status.position_m)
    share = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    velocity = np.zeros(3) if status.velocity_m_s is None else np.array(status.velocity_m_s)
    to_aim = np.array(status.set_point.position_m) - here
    far_m = float(np.linalg.norm(to_aim))
    to_aim *= min(1.0, AHEAD_S * SPEED_M_S / far_m) if far_m > 0.0 else 0.0
    return np.vstack((here + share * AHEAD_S * velocity, here + share * to_aim))
