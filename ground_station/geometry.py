"""Lines of the scene as arrays, and offsets from dragged handles."""

import math
from collections.abc import Sequence
from typing import Final

import msgspec
import numpy as np

from rcopterx.bus.messages import LeaderLink, Plan
from rcopterx.formation.topology import station
from rcopterx.vehicles.state import Array, three, turned_about_z

NOWHERE: Final = np.zeros((1, 2, 3))  # an invisible line


def heading_quaternion(yaw_rad: float) -> tuple[float, float, float, float]:
    """Quaternion w, x, y, z of a heading."""
    return (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))


def polyline(points: Array) -> Array:
    """Line through points as segments, shape (n - 1, 2, 3) [m]; a point where there are fewer than two."""
    return np.stack((points[:-1], points[1:]), axis=1) if len(points) > 1 else NOWHERE


def plan_segments(plan: Plan | None) -> Array:
    """Line of a plan as segments, shape (stages - 1, 2, 3) [m]; a point without a plan."""
    return NOWHERE if plan is None else polyline(plan.trajectory.to_numpy()[:, :3])


def box_edges(low: Array, high: Array) -> Array:
    """Edges of a box, shape (12, 2, 3) [m]."""
    corners = [np.where([i & 1, i & 2, i & 4], high, low) for i in range(8)]
    return np.array([(corners[i], corners[i | bit]) for bit in (1, 2, 4) for i in range(8) if not i & bit])


def place_beside(
    link: LeaderLink, leader_m: Sequence[float], leader_yaw_rad: float
) -> tuple[float, float, float]:
    """Place of a follower in the inertial frame [m]."""
    return three(station([link], [np.array([*leader_m, leader_yaw_rad])])[:3])


def link_to(
    link: LeaderLink, place_m: Sequence[float], leader_m: Sequence[float], leader_yaw_rad: float
) -> LeaderLink:
    """Link that puts its follower at a place [m]; the inverse of `place_beside`."""
    away = np.array(place_m, dtype=float) - np.array(leader_m, dtype=float)
    x, y, z = turned_about_z(away, -leader_yaw_rad if link.frame == "heading" else 0.0)
    offset_m = (round(float(x), 3), round(float(y), 3), round(float(z), 3))
    return msgspec.structs.replace(link, offset_m=offset_m)


def on_level(
    origin_m: Sequence[float], direction: Sequence[float], height_m: float
) -> tuple[float, float, float] | None:
    """Point where a ray meets a horizontal plane [m]; None if it does not, or behind its origin."""
    rise = float(direction[2])
    if abs(rise) < 1e-9:
        return None
    distance = (height_m - float(origin_m[2])) / rise
    if distance <= 0.0:
        return None
    x, y, _ = (float(a) + distance * float(b) for a, b in zip(origin_m, direction, strict=True))
    return x, y, height_m


def arrow(start_m: Sequence[float], vector_m: Sequence[float]) -> Array:
    """A horizontal arrow, shape (3, 2, 3) [m]: shaft and barbs of a quarter of its length."""
    shaft = np.array([*vector_m, 0.0])
    start = np.array(start_m)
    end = start + shaft
    barbs = [end - turned_about_z(0.25 * shaft, side * math.pi / 7) for side in (1, -1)]
    return np.array([(start, end), *((end, barb) for barb in barbs)])
