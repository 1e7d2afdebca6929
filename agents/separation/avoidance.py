"""Which plans of others constrain the plan of a vehicle in a control period. Pure; knows no bus."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from msgspec import Struct

from rcopterx.agents.flight.followed import LeaderPlan
from rcopterx.control.interfaces import Obstacle
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.native.plans import smallest_gaps
from rcopterx.vehicles.state import Array

NEAR: Final = 1.3
"""Plans that come no closer than this, in ellipsoids, constrain nothing."""
TOUCHING: Final = 1.02
"""Plans that come so close are held apart by their constraints."""


@dataclass(frozen=True)
class SeparationEllipsoid:
    """Half axes of the ellipsoid around a vehicle that no other one is to enter [m]."""

    horizontal_m: float = 0.35
    vertical_m: float = 0.6

    def __post_init__(self) -> None:
        for name, value in (("horizontal_m", self.horizontal_m), ("vertical_m", self.vertical_m)):
            if not 0.0 < value <= 5.0:
                raise ValueError(f"{name}: {value:g}, must be above 0 and at most 5")

    def normalised(self, gap_m: Array) -> Array:
        """Length of gaps, shape (.., 3), in ellipsoids: 1 on its surface."""
        return np.asarray(np.sqrt(gap_m**2 @ self.stiffness))

    @cached_property
    def stiffness(self) -> Array:
        """What squares of gaps x, y, z are multiplied by, shape (3,)."""
        return np.array([self.horizontal_m, self.horizontal_m, self.vertical_m]) ** -2


class Neighbour(Struct, frozen=True):
    """Another vehicle: its newest plan, and the scale of the ellipsoid that separates from it."""

    plan: LeaderPlan
    scale: float


class Near(Struct, frozen=True):
    """Vehicles that come near.

    Attributes
    ----------
    obstacles
        Vehicles whose plans come near.
    touching
        Whether the constraints hold any of them off, or shall do so.
    closest_m
        Smallest distance to any plan; infinite without one.
    """

    obstacles: tuple[Obstacle, ...]
    touching: bool
    closest_m: float


def near(
    ellipsoid: SeparationEllipsoid,
    neighbours: Mapping[str, Neighbour],
    plan: Trajectory,
    period_s: float,
    stages: int,
    delay_s: float,
) -> Near:
    """Find the plans that come near.

    Parameters
    ----------
    ellipsoid
        The ellipsoid.
    neighbours
        The others by name.
    plan
        The own previous plan, whose second stage is the present's first one.
    period_s, stages
        Control period, and number of stages N.
    delay_s
        Time from the present to the first stage.

    Returns
    -------
    Near
        In the order of the names, so that a vehicle keeps its place among the constraints.
    """
    obstacles: list[Obstacle] = []
    closest, closest_m = np.inf, np.inf
    for name in sorted(neighbours):
        neighbour = neighbours[name]
        scale = neighbour.scale
        if scale <= 0.0:
            continue
        other, start_s = neighbour.plan.trajectory, neighbour.plan.ahead_s + delay_s
        in_ellipsoids, gap_m = smallest_gaps(
            plan.samples,
            plan.period_s,
            period_s,
            other.samples,
            other.period_s,
            start_s,
            period_s,
            stages,
            ellipsoid.stiffness,
        )
        distance = in_ellipsoids / scale
        closest, closest_m = min(closest, distance), min(closest_m, gap_m)
        if distance < NEAR:
            other_m = other.positions_from(start_s, period_s, stages)
            obstacles.append(Obstacle(other_m, scale * ellipsoid.horizontal_m, scale * ellipsoid.vertical_m))
    return Near(tuple(obstacles), closest < TOUCHING, closest_m)
