"""The task of a vehicle at one moment."""

from dataclasses import dataclass, field

import numpy as np

from rcopterx.control.references.set_points import ReferenceSource, SetPointReference
from rcopterx.formation.law import FollowedLeader
from rcopterx.vehicles.phases import Phase
from rcopterx.vehicles.state import Array


@dataclass(slots=True)
class Task:
    """What a vehicle has to do, and how far it is; a successor of its agent continues there."""

    phase: Phase = Phase.GROUND
    source: ReferenceSource = field(default_factory=lambda: SetPointReference(np.zeros(3), 0.0))
    """Own reference: a set point, a move or a path, and when it began."""
    followed: tuple[FollowedLeader, ...] = ()  # leaders followed now, with transitions of their offsets
    assigned: tuple[FollowedLeader, ...] = ()  # leaders by fleet file or request; replaced while lost
    joined: frozenset[str] = frozenset()  # leaders whose offsets began to move from the vehicle's own place
    floor_m: float = 0.0  # height of the floor below the vehicle when it took off
    interrupted: Phase | None = None  # take-off or landing that the gateway has interrupted
    climb_end_m: Array = field(default_factory=lambda: np.zeros(3))  # where its last take-off ends
