"""The task of a vehicle at one moment."""

from dataclasses import dataclass

from rcopterx.control.references.set_points import ReferenceSource
from rcopterx.formation.law import FollowedLeader
from rcopterx.vehicles.phases import Phase


@dataclass(frozen=True, slots=True)
class Task:
    """What a vehicle has to do, and how far it is."""

    phase: Phase
    source: ReferenceSource  # own reference: a set point, a move or a path, and when it began
    followed: tuple[FollowedLeader, ...]  # leaders followed now, with transitions of their offsets
    assigned: tuple[FollowedLeader, ...]  # leaders by fleet file or request
    joined: frozenset[str]  # leaders whose offsets have begun to move from the vehicle's own place
    floor_m: float  # height of the floor below the vehicle when it took off
    interrupted: Phase | None = None  # phase that the gateway has interrupted, which resumes afterwards
