"""The task of a vehicle at one moment, whole: what its guidance hands to a successor."""

from dataclasses import dataclass

from rcopterx.agents.flight.followed import FollowedLeader
from rcopterx.agents.phases import Phase
from rcopterx.control.references.set_points import ReferenceSource


@dataclass(frozen=True, slots=True)
class Task:
    """What a vehicle was asked to do and how far it is.

    Attributes
    ----------
    phase
        Flight phase.
    source
        Reference of its own: a set point, a move or a path, with the fleet time at which it began.
    followed
        Leaders followed now, with offsets on their way.
    assigned
        Leaders by fleet file or request.
    joined
        Leaders whose offsets have begun to move from the vehicle's own place.
    floor_m
        Height of the floor below the vehicle when it took off.
    interrupted
        Phase that the transmitter gateway has interrupted and that goes on when it is over; None for none.
    """

    phase: Phase
    source: ReferenceSource
    followed: tuple[FollowedLeader, ...]
    assigned: tuple[FollowedLeader, ...]
    joined: frozenset[str]
    floor_m: float
    interrupted: Phase | None = None
