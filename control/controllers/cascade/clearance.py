"""Separation constraints: half-spaces between a vehicle's previous plan and the plans of others.

An ellipsoid around every vehicle, taller than wide because of the rotor wash, stays free of others. At each
stage the direction from the other to the own previous plan is the normal of a half-space that touches the
ellipsoid. It is split into a bound on the height and a row on the horizontal position, so that each problem
of the cascade stays convex; together they imply the ellipsoid.

A vehicle that flies straight towards another one turns the normal anticlockwise, seen from above: all pass
each other on the right, and two vehicles head-on do not mirror each other for ever.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.control.interfaces import Obstacle
from rcopterx.control.solver.problem import OptimalControlProblem
from rcopterx.vehicles.state import Array

SLOTS: Final = 6  # number of vehicles avoided at the same time
REACH: Final = 2.0  # stages that are farther apart than this, in ellipsoids, get no constraint
TURN_RAD: Final = 0.5  # how far the normal is turned when a vehicle flies straight towards another
SETTLED_M: Final = 0.3  # distance from the reference below which the turn fades out
LEVEL: Final = 0.3  # normals that rise less than this leave the height alone
NARROWEST_M: Final = 0.01  # range of heights that bounds leave at least
FLOOR_M: Final = 0.25  # vehicles below others are not pressed lower than this above their lowest height
FAR_M: Final = 20.0  # upper bound of the rows
_TINY: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Clearances:
    """Constraints of all stages around K ellipsoids."""

    directions: Array  # horizontal unit normals, shape (N, `SLOTS`, 2); zeros where there is no constraint
    centres_m: Array  # shape (N, K, 3)
    horizontal_m: Array
    vertical_m: Array  # half axes, shape (N, K)
    aside_m: Array  # least distance to the side at any height, the way out from below or above; shape (N, K)
    lowest_m: Array
    highest_m: Array  # bounds of the height, shape (N,); infinite where there is none

    def heights(self, bounds: Array) -> Array:
        """Return bounds of the height, shape (2, N); where there is no room, around the middle."""
        low = np.minimum(np.maximum(bounds[0], self.lowest_m), bounds[1] - NARROWEST_M)
        high = np.minimum(bounds[1], np.maximum(self.highest_m, bounds[0] + FLOOR_M))
        middle, none = 0.5 * (low + high), high - low < NARROWEST_M
        half = 0.5 * NARROWEST_M
        return np.array((np.where(none, middle - half, low), np.where(none, middle + half, high)))

    def least_m(self, height_m: Array) -> Array:
        """Return lower bounds of direction . position at planned heights (N,), shape (N, `SLOTS`)."""
        count = self.centres_m.shape[1]
        rise = np.clip((height_m[:, None] - self.centres_m[:, :, 2]) / self.vertical_m, -1.0, 1.0)
        needed = np.maximum(self.horizontal_m * np.sqrt(1.0 - rise**2), self.aside_m)
        least = np.zeros((len(height_m), SLOTS))
        least[:, :count] = needed + np.einsum(
            "ska,ska->sk", self.directions[:, :count], self.centres_m[:, :, :2]
        )
        return least

    def added_to(self, p: OptimalControlProblem, height_m: Array, weight: float) -> OptimalControlProblem:
        """Return the horizontal problem, whose first states are the position, with rows at planned heights.

        `weight`: that of the squared violation.
        """
        N, nx, nu = p.B.shape
        C = np.zeros((N, SLOTS, nx))
        C[:, :, :2] = self.directions[:N]
        least = self.least_m(height_m)[:N]
        s = np.where(self.directions[:N].any(axis=2), weight, 0.0)
        s[0] = 0.0
        none = np.zeros((N, SLOTS))
        return p._replace(
            C=np.concatenate((p.C, C), axis=1),
            D=np.concatenate((p.D, np.zeros((N, SLOTS, nu))), axis=1),
            W=np.hstack((p.W, none)),
            r=np.hstack((p.r, none)),
            low=np.hstack((p.low, least)),
            high=np.hstack((p.high, least + FAR_M)),
            s=np.hstack((p.s, s)),
        )


def clearances(previous_m: Array, wanted_m: Array, obstacles: Sequence[Obstacle]) -> Clearances:
    """Linearise the nearest `SLOTS` ellipsoids around a plan, `previous_m`, to fly to `wanted_m`."""
    axes = np.stack([other.half_axes_m for other in obstacles], axis=1)
    centres = np.stack([other.positions_m for other in obstacles], axis=1)
    gap = (previous_m[:, None, :] - centres) / axes
    distance = np.sqrt(np.einsum("ska,ska->sk", gap, gap))
    if len(obstacles) > SLOTS:
        chosen = np.sort(np.argsort(distance.min(axis=0), kind="stable")[:SLOTS])
        axes, centres, gap, distance = (each[:, chosen] for each in (axes, centres, gap, distance))
    straight, turned = normals(gap, (wanted_m - previous_m)[:, None, :] / axes, SETTLED_M / axes[:, :, 0])
    near = (distance < REACH)[:, :, None]
    straight, turned = straight * near, turned * near
    across = np.hypot(turned[:, :, 0], turned[:, :, 1])
    directions = np.zeros((len(turned), SLOTS, 2))
    count = axes.shape[1]
    directions[:, :count] = turned[:, :, :2] / np.maximum(across, _TINY)[:, :, None]
    directions[:, :count] *= (across > LEVEL / 10)[:, :, None]
    steep = straight[:, :, 2]
    tangent = centres[:, :, 2] + axes[:, :, 2] * steep
    return Clearances(
        directions,
        centres,
        axes[:, :, 0],
        axes[:, :, 2],
        axes[:, :, 0] * np.maximum(across - np.hypot(straight[:, :, 0], straight[:, :, 1]), 0.0),
        np.where(steep > LEVEL, tangent, -np.inf).max(axis=1),
        np.where(steep < -LEVEL, tangent, np.inf).min(axis=1),
    )


def normals(gap: Array, way: Array, settled: Array) -> tuple[Array, Array]:
    """Return unit normals away from the others, straight and turned, shape (N, K, 3) each.

    `gap` and `way`: from the other's to the own position, and from there to the reference, in half axes,
    shape (N, K, 3). `settled`: length of a way below which the turn fades out, shape (N, K).
    """
    distance = np.sqrt(np.einsum("ska,ska->sk", gap, gap))
    far = distance > _TINY
    normal = np.where(far[:, :, None], gap, [1.0, 0.0, 0.0]) / np.where(far, distance, 1.0)[:, :, None]
    length = np.sqrt(np.einsum("ska,ska->sk", way, way))
    towards = -np.einsum("ska,ska->sk", normal, way) / np.maximum(length, settled)
    turn = TURN_RAD * np.clip(towards, 0.0, 1.0)
    aside = np.zeros_like(normal)
    aside[:, :, 0], aside[:, :, 1] = -normal[:, :, 1], normal[:, :, 0]
    across = np.hypot(aside[:, :, 0], aside[:, :, 1])
    level = across > _TINY
    aside = np.where(level[:, :, None], aside, [1.0, 0.0, 0.0]) / np.where(level, across, 1.0)[:, :, None]
    return normal, np.cos(turn)[:, :, None] * normal + np.sin(turn)[:, :, None] * aside
