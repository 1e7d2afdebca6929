"""The task of a vehicle at one moment, from which the guidance of a successor continues."""

from dataclasses import dataclass

from rcopterx.agents.flight.followed import FollowedLeader
from rcopterx.agents.phases import Phase
from rcopterx.control.references.set_points import ReferenceSource


@dataclass(frozen=True, slots=True)
class Task:
    """What a vehicle has to do, and how far it is.

    Attributes
    ----------
    source
        Own reference: a set point, a move or a path, with the fleet time at which it began.
    followed
        Leaders followed now, with transitions of their offsets.
    assigned
        Leaders by fleet file or request.
    joined
        Leaders whose offsets have begun to move from the vehicle's own place.
    floor_m
        Height of the floor below the vehicle when it took off.
    interrupted
        Phase that the transmitter gateway has interrupted and that resumes afterwards; None for none.
    """

    phase: Phase
    source: ReferenceSource
    followed: tuple[FollowedLeader, ...]
    assigned: tuple[FollowedLeader, ...]
    joined: frozenset[str]
    floor_m: float
    interrupted: Phase | None = None
