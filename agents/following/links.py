"""Links of the guidance from and to their messages."""

import numpy as np

from agents.flight.guidance import Link
from agents.formation.law import FormationOffset
from bus.messages import Following


def link_of(following: Following) -> Link:
    """A link of the guidance from its message."""
    offset = FormationOffset(
        np.array(following.offset_m),
        following.yaw_offset_rad,
        "heading" if following.frame == "heading" else "inertial",
    )
    return Link(following.leader, offset, following.weight)


def following_of(link: Link, time_s: float) -> Following:
    """Message of a link with the offset of this moment."""
    return _following(link, link.offset_at(time_s))


def following_at_rest(link: Link) -> Following:
    """Message of a link with the offset to be reached."""
    return _following(link, link.target)


def _following(link: Link, offset: FormationOffset) -> Following:
    x, y, z = offset.position_m.tolist()
    return Following(
        leader=link.leader,
        offset_m=(x, y, z),
        yaw_offset_rad=offset.yaw_rad,
        frame=offset.frame,
        weight=link.weight,
    )
