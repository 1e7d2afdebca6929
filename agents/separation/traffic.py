"""Plans of vehicles that could come near: heard as long as they could, and no longer.

Everybody's plans would cost each agent fifty wake-ups a second and vehicle. Statuses, five a second, tell
where vehicles are and where they are going; who could meet whom follows from that, and only those plans are
subscribed to. They wake nobody and are decoded when a control period begins.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from rcopterx.agents.flight.fleet_clock import FleetClock
from rcopterx.agents.flight.followed import LeaderPlan
from rcopterx.agents.following.leader_plans import leader_plan
from rcopterx.agents.formation.present import formation_of
from rcopterx.agents.formation.topology import places, roots
from rcopterx.agents.phases import Phase
from rcopterx.agents.separation.avoidance import Neighbour, SeparationEllipsoid
from rcopterx.agents.separation.ellipsoid_scales import ellipsoid_scale
from rcopterx.bus.messages import AgentStatus, Plan
from rcopterx.bus.subscription import Inbox
from rcopterx.vehicles.state import Array

TEND_EVERY_TICKS: Final = 10
AHEAD_S: Final = 1.2
"""Ways are looked at so far ahead; a horizon, and the time between two statuses."""
SPEED_M_S: Final = 1.3
SAMPLES: Final = 5
MEET: Final = 1.8
"""Ways that come no closer than this, in ellipsoids, do not meet."""
IN_PLACE_M: Final = 0.25
"""A vehicle of the same formation no farther than this from its place beside the own one is in place."""
MOST: Final = 8
"""Plans heard at the same time; the nearest ones."""
PATIENCE: Final = 5
"""A plan is heard on for so many looks after it was needed last."""
OLDEST_S: Final = 0.5
"""Age of a plan that still tells where its vehicle is."""


class Traffic:
    """Other vehicles' plans, for separation.

    Parameters
    ----------
    ellipsoid
        The ellipsoid; None for no avoidance.
    subscribe
        Opens a subscription to the plan of a vehicle, one that does not wake the loop.
    """

    events: Mapping[str, int] = MappingProxyType({})

    def __init__(
        self,
        vehicle: str,
        ellipsoid: SeparationEllipsoid | None,
        subscribe: Callable[[str], Inbox[Plan]],
    ) -> None:
        self._vehicle = vehicle
        self._ellipsoid = ellipsoid
        self._subscribe = subscribe
        self._inboxes: dict[str, Inbox[Plan]] = {}
        self._scales: dict[str, float] = {}
        self._looks: dict[str, int] = {}
        self._ticks = 0
        self.most = MOST
        """Plans heard at the same time; fewer while the computer cannot keep up."""
        self._rejected: Counter[str] = Counter()

    def due(self) -> bool:
        """Whether it is time for another look; to be asked once in every control period."""
        self._ticks += 1
        return self._ellipsoid is not None and self._ticks % TEND_EVERY_TICKS == 1

    def update(self, own: AgentStatus, others: Mapping[str, AgentStatus]) -> None:
        """Look who could come near, and hear those."""
        if self._ellipsoid is None:
            return
        wanted: dict[str, float] = {}
        if own.phase == Phase.FLYING and own.position_m is not None:
            links, heads = formation_of({**others, self._vehicle: own})
            where = places(links, heads)
            self._scales = {
                name: ellipsoid_scale(self._ellipsoid, links, where, self._vehicle, name) for name in others
            }
            mates = {
                name
                for name in others
                if set(roots(links, name)) & set(roots(links, self._vehicle))
                and name in where
                and self._vehicle in where
            }
            ahead = way(own)
            for name, status in others.items():
                if status.position_m is None or not self._scales[name]:
                    continue
                if name in mates:
                    gap = np.subtract(status.position_m, own.position_m)
                    if np.linalg.norm(gap - (where[name] - where[self._vehicle])[:3]) < IN_PLACE_M:
                        continue
                distance = float(self._ellipsoid.normalised(ahead[:, None] - way(status)).min())
                if distance < MEET:
                    wanted[name] = distance
        self._hear(sorted(wanted, key=lambda name: wanted[name])[: self.most])

    def _hear(self, wanted: list[str]) -> None:
        for name in tuple(self._looks):
            self._looks[name] -= 1
        self._looks |= dict.fromkeys(wanted, PATIENCE)
        for name in wanted:
            if name not in self._inboxes:
                self._inboxes[name] = self._subscribe(name)
        for name in [name for name, left in self._looks.items() if left <= 0]:
            del self._looks[name]
            inbox = self._inboxes.pop(name)
            self._rejected.update(inbox.rejected)
            inbox.close()

    def neighbours(self, clock: FleetClock, plans: Mapping[str, LeaderPlan]) -> dict[str, Neighbour]:
        """Those who are heard, and the leaders, whose plans are known anyway."""
        if self._ellipsoid is None:
            return {}
        scales = self._scales
        if not (scales and (plans or self._inboxes)):
            return {}
        found = {}
        for name, plan in plans.items():
            if plan.ahead_s < OLDEST_S and name in scales:
                found[name] = Neighbour(plan, scales[name])
        for name, inbox in self._inboxes.items():
            received = None if name in found else inbox.latest()
            if received is None or received.message.epoch != clock.epoch:
                continue
            plan = leader_plan(received.message, clock)
            if plan.ahead_s < OLDEST_S and name in scales:
                found[name] = Neighbour(plan, scales[name])
        return found

    @property
    def rejected(self) -> Mapping[str, int]:
        """Refused plans by reason, those of subscriptions that are closed included."""
        total = Counter(self._rejected)
        for inbox in self._inboxes.values():
            total.update(inbox.rejected)
        return {f"neighbour_plan.{kind}": count for kind, count in total.items()}


def way(status: AgentStatus) -> Array:
    """Places a vehicle may come to in the next second, shape (2 `SAMPLES`, 3), by its speed and its aim."""
    here = np.array(status.position_m)
    share = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    velocity = np.zeros(3) if status.velocity_m_s is None else np.array(status.velocity_m_s)
    to_aim = np.array(status.set_point.position_m) - here
    far_m = float(np.linalg.norm(to_aim))
    to_aim *= min(1.0, AHEAD_S * SPEED_M_S / far_m) if far_m > 0.0 else 0.0
    return np.vstack((here + share * AHEAD_S * velocity, here + share * to_aim))
