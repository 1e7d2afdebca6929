"""Plans of the leaders: following a vehicle is a subscription to its plan."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from rcopterx.agents.flight.timeline import FleetClock
from rcopterx.bus import channels
from rcopterx.bus.messages import AgentStatus, LeaderLink, Plan
from rcopterx.bus.subscription import Inbox, Received
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.formation.law import FollowedLeader, FormationOffset, LeaderPlan
from rcopterx.formation.topology import FormationGraph, formation_of
from rcopterx.vehicles.state import Array, three


def leader_plan(plan: Plan, clock: FleetClock, with_nominal: bool = True) -> LeaderPlan:
    """Return a plan of the same epoch on the clock of this vehicle."""
    ahead_s = (clock.current_frame - plan.frame) * clock.period_s - plan.start_s
    trajectory = Trajectory(plan.trajectory.to_numpy(), plan.period_s)
    packed = plan.nominal if with_nominal else None
    nominal = None if packed is None else Trajectory(packed.to_numpy(), plan.period_s)
    followable, margins_m = plan.airborne and plan.followable, plan.margins_m or (0.0,)
    return LeaderPlan(trajectory, ahead_s, followable, nominal, margins_m)


class LeaderPlans:
    """Subscriptions to the plans a vehicle needs, re-keyed as its leaders change."""

    def __init__(self, vehicle: str, subscribe: Callable[[str], Inbox[Plan]]) -> None:
        self._rejected: Counter[str] = Counter()
        self._vehicle = vehicle
        self._subscribe = subscribe
        self._inboxes: dict[str, Inbox[Plan]] = {}
        self._newest: dict[str, Received[Plan]] = {}
        self.awaited = True  # whether the agent waits for plans; they need not wake it otherwise

    def subscribe_to(self, names: Iterable[str]) -> None:
        """Subscribe to exactly these leaders, to new ones first."""
        wanted = set(names)
        for name in wanted - self._inboxes.keys():
            self._inboxes[name] = self._subscribe(name)
        for name in self._inboxes.keys() - wanted:
            self._newest.pop(name, None)
            inbox = self._inboxes.pop(name)
            self._rejected.update({f"plan.{kind}": count for kind, count in inbox.rejected.items()})
            inbox.close()

    def receive(self) -> None:
        """Read the newest plans, which all other methods use, once in a step."""
        for name, inbox in self._inboxes.items():
            received = inbox.latest()
            if received is not None:
                self._newest[name] = received

    def newest(self, name: str) -> Plan | None:
        """Newest plan of a leader, None before the first."""
        received = self._newest.get(name)
        return None if received is None else received.message

    def fresh(self, name: str, now_s: float) -> Plan | None:
        """Newest plan of a leader; None before the first, and if the leader is silent."""
        received = self._newest.get(name)
        silent = received is None or now_s - received.arrived_s > channels.PLAN.stale_after_s
        return None if silent else self.newest(name)

    def complete(self, epoch: int, frame: int, names: Iterable[str]) -> bool:
        """Return whether the plans of these leaders belong to this frame of this epoch, or to later ones."""
        for name in names:
            received = self._newest.get(name)
            if received is None or (received.message.epoch, received.message.frame) < (epoch, frame):
                return False
        return True

    def plans(self, clock: FleetClock, cycles_from: tuple[int, int] = (0, 0)) -> Mapping[str, LeaderPlan]:
        """Return plans on this vehicle's clock; ancestors in those before `cycles_from` may be outdated."""
        found = {}
        for name, received in self._newest.items():
            plan = received.message
            if plan.epoch != clock.epoch:
                self._rejected["plan.epoch"] += 1
                continue
            if self._vehicle in plan.ancestors and (plan.epoch, plan.frame) >= cycles_from:
                # Two vehicles began to follow each other at the same moment; neither of them moves.
                self._rejected["plan.leader_cycle"] += 1
                continue
            found[name] = leader_plan(plan, clock)
        return found

    def ancestors(self, names: Iterable[str]) -> tuple[str, ...]:
        """These leaders and their ancestors, nearest first, each once."""
        line: dict[str, None] = dict.fromkeys(names)
        for name in tuple(line):
            plan = self.newest(name)
            if plan is not None:
                line |= dict.fromkeys(plan.ancestors)
        return tuple(line)

    def level(self, names: Iterable[str]) -> int:
        """Return the number of vehicles above this one: the most that a leader and its ancestors are."""
        plans = map(self.newest, names)
        return max((1 if plan is None else 1 + len(plan.ancestors) for plan in plans), default=0)

    def cycle_through(self, name: str) -> tuple[str, ...] | None:
        """Return the line of ancestors from a leader back to this vehicle; None if there is none."""
        plan = self.newest(name)
        if name == self._vehicle:
            return (name,)
        if plan is not None and self._vehicle in plan.ancestors:
            return (name, *plan.ancestors[: plan.ancestors.index(self._vehicle) + 1])
        return None

    @property
    def rejected(self) -> Mapping[str, int]:
        """Refused plans by reason, past leaders included."""
        total = Counter(self._rejected)
        for inbox in self._inboxes.values():
            total.update({f"plan.{kind}": count for kind, count in inbox.rejected.items()})
        return dict(total)

    def plan_age_s(self, now_s: float, names: Iterable[str]) -> float | None:
        """Age of the oldest of these leaders' newest plans; None if one is missing, or without leaders."""
        newest = [self._newest.get(name) for name in names]
        ages = [max(0.0, now_s - received.arrived_s) for received in newest if received is not None]
        return max(ages) if ages and len(ages) == len(newest) else None


@dataclass
class PeerStatuses:
    """Newest statuses of the other vehicles; `clock` is monotonic [s]."""

    vehicle: str
    inboxes: Mapping[str, Inbox[AgentStatus]]
    clock: Callable[[], float]

    def statuses(self, within_s: float = math.inf) -> dict[str, AgentStatus]:
        """Statuses of the vehicles that are not silent and not older than `within_s`."""
        now_s = self.clock()
        found = {}
        for name, inbox in tuple(self.inboxes.items()):
            received = None if name == self.vehicle else inbox.latest()
            if received is not None:
                limit_s = min(within_s, inbox.channel.stale_after_s)
                if now_s - received.arrived_s <= limit_s:
                    found[name] = received.message
        return found

    def formation(self) -> tuple[FormationGraph, dict[str, Array]]:
        """Links and heads of the formation of those, and of the own vehicle, in flight."""
        return formation_of(self.statuses(), flying=(self.vehicle,))


def followed_leader(following: LeaderLink) -> FollowedLeader:
    """A link of the guidance from its message."""
    offset = FormationOffset(
        np.array(following.offset_m, dtype=np.float64),
        following.yaw_offset_rad,
        "heading" if following.frame == "heading" else "inertial",
    )
    return FollowedLeader(following.leader, offset, following.weight)


def target_link(link: FollowedLeader) -> LeaderLink:
    """Message of a link with the offset to be reached."""
    return link_message(link, link.target)


def link_message(link: FollowedLeader, offset: FormationOffset) -> LeaderLink:
    """Message of a link with an offset."""
    return LeaderLink(
        leader=link.leader,
        offset_m=three(offset.position_m),
        yaw_offset_rad=offset.yaw_rad,
        frame=offset.frame,
        weight=link.weight,
    )
