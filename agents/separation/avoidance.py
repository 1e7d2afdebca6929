"""Keeps the plan of a vehicle clear of the plans of others, as far as its controller can."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from msgspec import Struct

from rcopterx.agents.guards.step_guard import StepGuard
from rcopterx.control.interfaces import Obstacle
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.formation.law import LeaderPlan
from rcopterx.vehicles.state import Array, Z

NEAR: Final = 1.3  # plans that come no closer than this, in ellipsoids, constrain nothing
TOUCHING: Final = 1.02  # plans that come so close are held apart by their constraints
ENTERED_M: Final = 0.1  # depth to which a plan may enter the ellipsoid of a subject, which gives no way
OVER_S: Final = 1.0  # for so long a vehicle stays above one that was too fast


@dataclass(frozen=True)
class SeparationEllipsoid:
    """Half axes of the ellipsoid around a vehicle that no other one is to enter [m]."""

    horizontal_m: float = 0.35
    vertical_m: float = 0.6

    def __post_init__(self) -> None:
        for name, value in (("horizontal_m", self.horizontal_m), ("vertical_m", self.vertical_m)):
            if not 0.0 < value <= 5.0:
                raise ValueError(f"{name}: {value:g}, must be above 0 and at most 5")

    @property
    def half_axes_m(self) -> Array:
        """Half axes along x, y, z."""
        return np.array((self.horizontal_m, self.horizontal_m, self.vertical_m))

    def normalised(self, gap_m: Array) -> Array:
        """Length of gaps, shape (.., 3), in ellipsoids: 1 on its surface."""
        return np.asarray(np.linalg.norm(gap_m / self.half_axes_m, axis=-1))


class NeighbourPlan(Struct, frozen=True):
    """Another vehicle: its newest plan, and the scale of the ellipsoid that separates from it."""

    plan: LeaderPlan
    scale: float


class Near(Struct, frozen=True):
    """Vehicles that come near."""

    neighbours: tuple[Obstacle, ...]  # all vehicles
    obstacles: tuple[Obstacle, ...]  # those whose plans come near
    touching: bool  # whether any of them is, or should be, held off by the constraints
    closest_m: float  # smallest distance to any plan; infinite without one
    over_m: float  # height above subjects that are too fast to be avoided to the side; -infinite without one


def near(
    ellipsoid: SeparationEllipsoid,
    neighbours: Mapping[str, NeighbourPlan],
    plan: Trajectory,
    period_s: float,
    stages: int,
    delay_s: float,
    side_m_s2: float = 0.0,
) -> Near:
    """Find the plans that come near; the obstacles keep their places among the constraints, by name.

    `side_m_s2` is the acceleration with which the vehicle surely moves to the side.
    """
    way_m = ENTERED_M + 0.5 * side_m_s2 * (period_s * np.arange(stages)) ** 2
    own_m = plan.resampled(period_s, period_s, stages).position_m
    others: list[Obstacle] = []
    obstacles: list[Obstacle] = []
    closest, closest_m, over_m = np.inf, np.inf, -np.inf
    for _, neighbour in sorted(neighbours.items()):
        scale = neighbour.scale
        if scale <= 0.0:
            continue
        other = neighbour.plan
        other_m = other.trajectory.resampled(other.ahead_s + delay_s, period_s, stages).position_m
        margins_m = other.margins_at(other.ahead_s + delay_s, period_s, stages)
        half_axes_m = scale * ellipsoid.half_axes_m + margins_m[:, None]
        others.append(Obstacle(other_m, half_axes_m))
        gap_m = own_m - other_m
        distances = np.linalg.norm(gap_m / half_axes_m, axis=1)
        distance = float(distances.min())
        if len(other.margins_m) > 1 and ((1.0 - distances) * half_axes_m[:, 0] > way_m).any():
            over_m = max(over_m, float((other_m + half_axes_m)[distances < 1.0, Z].max()))
        closest = min(closest, distance)
        closest_m = min(closest_m, float(np.linalg.norm(gap_m, axis=1).min()))
        if distance < NEAR:
            obstacles.append(others[-1])
    return Near(tuple(others), tuple(obstacles), closest < TOUCHING, closest_m, over_m)


class PlanAvoidance:
    """Passes the plans that come near to the controller of one vehicle."""

    def __init__(self, ellipsoid: SeparationEllipsoid | None, step_guard: StepGuard) -> None:
        self._ellipsoid = ellipsoid
        self._step_guard = step_guard
        self.over_m = -np.inf  # least height, above subjects that are too fast to be avoided to the side
        self._over_left = 0  # for so many control periods
        self.ticks = 0  # control periods in which separation constraints held the plan off another one
        self.closest_m: float | None = None  # smallest distance to another plan so far, if any

    def update(
        self, neighbours: Mapping[str, NeighbourPlan], plan: Trajectory | None, free: bool, delay_s: float
    ) -> bool:
        """Update the obstacles of the controller; return False if plans touch and it avoids none.

        Only `free` flight gives way. `delay_s` is from the present to the first stage of `plan`.
        """
        controller = self._step_guard.controller
        obstacles: tuple[Obstacle, ...] = ()
        touching = False
        self._step_guard.neighbours = ()
        self._over_left -= 1
        self.over_m = self.over_m if self._over_left > 0 else -np.inf
        if neighbours and self._ellipsoid is not None and plan is not None and free:
            side_m_s2 = float(self._step_guard.model.sure_reach[0])
            period_s, horizon = controller.period_s, controller.horizon
            found = near(self._ellipsoid, neighbours, plan, period_s, horizon, delay_s, side_m_s2)
            if found.closest_m < (np.inf if self.closest_m is None else self.closest_m):
                self.closest_m = found.closest_m
            obstacles, touching = found.obstacles, found.touching
            if found.over_m > -np.inf:
                self._over_left = round(OVER_S / period_s)
            self.over_m = max(self.over_m, found.over_m)
            # The next plan may differ from the last one.
            self._step_guard.neighbours = found.neighbours
        if self._step_guard.avoiding is None:
            return not touching
        self._step_guard.set_obstacles(obstacles)
        self.ticks += touching
        return True
