"""Links of the guidance from and to their messages."""

import numpy as np

from rcopterx.agents.flight.task import FollowedLeader
from rcopterx.agents.formation.law import FormationOffset
from rcopterx.bus.messages import LeaderLink


def followed_leader(following: LeaderLink) -> FollowedLeader:
    """A link of the guidance from its message."""
    offset = FormationOffset(
        np.array(following.offset_m, dtype=np.float64),
        following.yaw_offset_rad,
        "heading" if following.frame == "heading" else "inertial",
    )
    return FollowedLeader(following.leader, offset, following.weight)


def present_link(link: FollowedLeader, time_s: float) -> LeaderLink:
    """Message of a link with the offset of this moment."""
    return _following(link, link.offset_at(time_s))


def target_link(link: FollowedLeader) -> LeaderLink:
    """Message of a link with the offset to be reached."""
    return _following(link, link.target)


def _following(link: FollowedLeader, offset: FormationOffset) -> LeaderLink:
    x, y, z = offset.position_m.tolist()
    return LeaderLink(
        leader=link.leader,
        offset_m=(x, y, z),
        yaw_offset_rad=offset.yaw_rad,
        frame=offset.frame,
        weight=link.weight,
    )
