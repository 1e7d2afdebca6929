"""What a follower does about leaders it has lost: a table, and a successor all agree on without asking.

A lost leader is one whose plan does not come any more, or who does not fly freely any more. First its last
plan is used up, then the place is held; after a while the vehicle does what the fleet file says.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Final

import numpy as np

from rcopterx.agents.formation.topology import FormationGraph, link_between, places
from rcopterx.bus.messages import LeaderLink


class Finding(StrEnum):
    """How a follower's leaders are."""

    HERE = "here"
    """At least one plan of the last few frames."""
    LATE = "late"
    """No such plan, but one that reaches into the present."""
    GONE = "gone"
    """No plan to fly by."""
    LOST = "lost"
    """No plan to fly by for so long that they are not waited for any more."""


class Policy(StrEnum):
    """What to do about lost leaders."""

    HOLD = "hold"
    PROMOTE = "promote"
    LAND = "land"


class Successor(StrEnum):
    """Who leads instead."""

    NONE = "none"
    SELF = "self"
    OTHER = "other"


class FollowingMode(StrEnum):
    """What a follower does."""

    FOLLOW = "follow"
    USE_LAST_PLAN = "use_last_plan"
    """Fly by the last plan."""
    HOLD = "hold"
    """Keep the place."""
    LEAD = "lead"
    """Keep the place, and lead those who lost the same leader."""
    FOLLOW_SUCCESSOR = "follow_successor"
    LAND = "land"


@dataclass(frozen=True)
class Succession:
    """What a follower does about lost leaders.

    Attributes
    ----------
    policy
        `hold`, `promote` or `land`.
    after_s
        Time without a plan to fly by after which leaders are not waited for any more.
    orders
        Successors of each leader, the first one first; the same on every vehicle.
    promotable
        Vehicles whose policy is `promote`.
    """

    policy: str = "hold"
    after_s: float = 2.0
    orders: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    promotable: frozenset[str] = frozenset()


def _row(finding: Finding, policy: Policy, successor: Successor) -> FollowingMode:
    match finding, policy, successor:
        case Finding.HERE, _, _:
            return FollowingMode.FOLLOW
        case Finding.LATE, _, _:
            return FollowingMode.USE_LAST_PLAN
        case Finding.LOST, Policy.LAND, _:
            return FollowingMode.LAND
        case Finding.LOST, Policy.PROMOTE, Successor.SELF:
            return FollowingMode.LEAD
        case Finding.LOST, Policy.PROMOTE, Successor.OTHER:
            return FollowingMode.FOLLOW_SUCCESSOR
        case _:
            return FollowingMode.HOLD


FOLLOWING_MODES: Final = MappingProxyType(
    {
        (finding, policy, successor): _row(finding, policy, successor)
        for finding in Finding
        for policy in Policy
        for successor in Successor
    }
)
"""Every combination; nothing else than the present decides, so a leader that returns is followed again."""


def successor_of(
    lost: str, links: FormationGraph, ready: Collection[str], order: Iterable[str]
) -> str | None:
    """Who leads the followers of a lost leader.

    Everybody who lost the leader comes to the same answer from what vehicles tell of themselves: the first
    one in a fixed order that followed it, flies, and may lead.

    Parameters
    ----------
    lost
        The leader.
    links
        Assigned leaders of everybody.
    ready
        Vehicles that fly and may lead.
    order
        Successors of this leader, the first one first; from the fleet file, the same for everybody.

    Returns
    -------
    str or None
        Its name; None if nobody can.
    """
    for name in order:
        if name in ready and any(link.leader == lost for link in links.get(name, ())):
            return name
    return None


def link_to_successor(
    vehicle: str, successor: str, lost: str, links: Mapping[str, tuple[LeaderLink, ...]], yaw_rad: float
) -> LeaderLink | None:
    """Link that keeps a vehicle where it was beside its fellow follower; None where that is not known.

    Parameters
    ----------
    vehicle, successor, lost
        Names.
    links
        Assigned leaders of both followers.
    yaw_rad
        Last heading of the lost leader, for offsets in its heading frame.
    """
    own, other = (
        next((link for link in links.get(name, ()) if link.leader == lost), None)
        for name in (vehicle, successor)
    )
    if own is None or other is None:
        return None
    where = places(
        {lost: (), vehicle: (own,), successor: (other,)}, {lost: np.array([0.0, 0.0, 0.0, yaw_rad])}
    )
    return link_between(where[vehicle], where[successor], own, successor)
