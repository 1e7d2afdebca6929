"""The task of a vehicle at one moment, from which the guidance of a successor continues."""

from dataclasses import dataclass

from rcopterx.agents.flight.followed import FollowedLeader
from rcopterx.agents.phases import Phase
from rcopterx.control.references.set_points import ReferenceSource


@dataclass(frozen=True, slots=True)
class Task:
    """What a vehicle has to do, and how far it is."""

    phase: Phase
    source: ReferenceSource
    """Own reference: a set point, a move or a path, with the fleet time at which it began."""
    followed: tuple[FollowedLeader, ...]
    """Leaders followed now, with transitions of their offsets."""
    assigned: tuple[FollowedLeader, ...]
    """Leaders by fleet file or request."""
    joined: frozenset[str]
    """Leaders whose offsets have begun to move from the vehicle's own place."""
    floor_m: float
    """Height of the floor below the vehicle when it took off."""
    interrupted: Phase | None = None
    """Phase that the transmitter gateway has interrupted and that resumes afterwards; None for none."""
