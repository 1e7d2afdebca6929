"""Loss of leaders: a table of what a follower does, and the successor of a lost leader.

A leader is lost if its plans stop, or if it leaves free flight. The follower first uses up the last plan,
then holds its place; after a while it applies the policy of the fleet file.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.formation.topology import FormationGraph, link_between, places


class Finding(StrEnum):
    """State of a follower's leaders."""

    HERE = "here"  # there is a plan of the last few frames
    LATE = "late"  # the newest plan is older, but reaches into the present
    GONE = "gone"  # no plan reaches into the present
    LOST = "lost"  # the same for longer than `Succession.after_s`


class Policy(StrEnum):
    """Policy for lost leaders."""

    HOLD = "hold"
    PROMOTE = "promote"
    LAND = "land"


class FollowingMode(StrEnum):
    """What a follower does."""

    FOLLOW = "follow"
    USE_LAST_PLAN = "use_last_plan"  # follow the last plan
    HOLD = "hold"  # hold the place
    LEAD = "lead"  # hold the place, and lead those that lost the same leader
    FOLLOW_SUCCESSOR = "follow_successor"
    LAND = "land"


@dataclass(frozen=True)
class Succession:
    """Settings for lost leaders."""

    policy: str = "hold"  # `hold`, `promote` or `land`
    after_s: float = 2.0  # time without a usable plan after which a leader counts as lost
    orders: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Successors of each leader, the first one first; the same on every vehicle."""
    promotable: frozenset[str] = frozenset()  # vehicles whose policy is `promote`


def following_mode(finding: Finding, policy: str, vehicle: str, successor: str | None) -> FollowingMode:
    """Return what a vehicle does; only the present decides: a leader that returns is followed again.

    `successor` is the vehicle that replaces the lost leader, if any.
    """
    match finding, policy:
        case Finding.HERE, _:
            return FollowingMode.FOLLOW
        case Finding.LATE, _:
            return FollowingMode.USE_LAST_PLAN
        case Finding.LOST, Policy.LAND:
            return FollowingMode.LAND
        case Finding.LOST, Policy.PROMOTE if successor is not None:
            return FollowingMode.LEAD if successor == vehicle else FollowingMode.FOLLOW_SUCCESSOR
        case _:
            return FollowingMode.HOLD


def successor_of(
    lost: str, links: FormationGraph, ready: Collection[str], order: Iterable[str]
) -> str | None:
    """Return the first in `order` that is `ready` to lead and followed the lost leader, the same for all."""
    for name in order:
        if name in ready and any(link.leader == lost for link in links.get(name, ())):
            return name
    return None


def link_to_successor(
    vehicle: str, successor: str, lost: str, links: Mapping[str, tuple[LeaderLink, ...]], yaw_rad: float
) -> LeaderLink | None:
    """Link that keeps a vehicle where it was beside its fellow follower; None where that is not known."""
    own, other = (
        next((link for link in links.get(name, ()) if link.leader == lost), None)
        for name in (vehicle, successor)
    )
    if own is None or other is None:
        return None
    where = places({lost: (), vehicle: (own,), successor: (other,)}, {lost: np.array([0.0, 0, 0, yaw_rad])})
    return link_between(where[vehicle], where[successor], own, successor)
