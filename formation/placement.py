"""Refusal of places in a formation that leave the flight volume or are too close to another vehicle."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from rcopterx.bus.messages import AgentStatus, LeaderLink
from rcopterx.control.references.columns import POSE
from rcopterx.formation.topology import AT_WORK, FormationGraph, followers, formation_of, places
from rcopterx.vehicles.state import Array
from rcopterx.vehicles.tuples import Three

TOLERANCE_M = 1e-6


@dataclass(frozen=True)
class Room:
    """What a formation has to stay within."""

    min_m: Three
    max_m: Three  # flight volume, inertial frame
    minimum_distance_m: float | None = 0.3  # smallest distance between two vehicles; None for no limit

    def outside(self, place: Array) -> str | None:
        """Describe how a place, x y z first, or the first of several leaves the volume; None if none does."""
        places_m = np.atleast_2d(place)[:, :3].T
        for axis, values_m, low, high in zip("xyz", places_m, self.min_m, self.max_m, strict=True):
            inside = (low - TOLERANCE_M <= values_m) & (values_m <= high + TOLERANCE_M)
            if not inside.all():
                value = float(values_m[np.argmin(inside)])
                return f"{axis}: {value:.4g} m is outside the flight volume {low:g} .. {high:g} m"
        return None

    def too_close(self, name: str, place: Array, other_name: str, other: Array) -> str | None:
        """Describe why two vehicles would be too near, one at the nearest of places; None if they are not."""
        if self.minimum_distance_m is None:
            return None
        distance_m = float(np.linalg.norm(place[..., :3] - other[:3], axis=-1).min())
        if distance_m >= self.minimum_distance_m - TOLERANCE_M:
            return None
        return (
            f"{name} and {other_name} would be {distance_m:.3g} m apart, "
            f"the minimum distance is {self.minimum_distance_m:g} m"
        )


def offset_problem(name: str, following: Iterable[LeaderLink], room: Room) -> str | None:
    """Return why an offset is too small; None if it is not, and for several leaders, whose places count."""
    links = tuple(following)
    if len(links) != 1:
        return None
    return room.too_close(name, np.array(links[0].offset_m), links[0].leader, np.zeros(3))


def place_problem(
    name: str,
    following: tuple[LeaderLink, ...],
    links: FormationGraph,
    heads: Mapping[str, Array],
    room: Room,
) -> str | None:
    """Return why a vehicle cannot follow its new leaders, None if it can; its followers come along."""
    after = {**links, name: following}
    where = places(after, heads)
    if name not in where:
        return None
    along = followers(after, name)
    problem = _leaving((name, *along), where, room)
    if problem is not None:
        return problem
    for moved in (name, *along):
        for other, place in where.items():
            if other == moved or moved not in where or (other in along and moved != name):
                continue
            problem = room.too_close(moved, where[moved], other, place)
            if problem is not None:
                return problem
    return None


def take_off_problem(
    name: str,
    floor_m: Array,
    height_m: float,
    following: tuple[LeaderLink, ...],
    statuses: Mapping[str, AgentStatus],
    room: Room,
) -> str | None:
    """Return why the column above a place, or the place beside leaders in the air, is not free, or None."""
    for other, status in statuses.items():
        if status.position_m is None or other == name:
            continue
        place = np.array(status.position_m)
        nearest = np.array([*floor_m[:2], np.clip(place[2], floor_m[2], floor_m[2] + height_m)])
        problem = room.too_close(name, nearest, other, place)
        if problem is not None:
            return f"on its way up {problem}"
    if not all(link.leader in statuses and statuses[link.leader].phase in AT_WORK for link in following):
        return None
    others = {other: status for other, status in statuses.items() if other != name}
    return place_problem(name, following, *formation_of(others, flying=(name,)), room)


def move_problem(
    name: str,
    samples: Array,
    links: FormationGraph,
    heads: Mapping[str, Array],
    room: Room,
    unrelated: Mapping[str, Array],
) -> str | None:
    """Return why a vehicle that leads cannot go somewhere, None if it can; its followers come along.

    `samples`: its places in future, x, y, z [m], yaw [rad] first, shape (k, 4 or more). `heads`: places of
    other leaders, shape (4,). `unrelated`: places of others, x y z first, which do not avoid its plan.
    """
    where = places({**links, name: ()}, {**heads, name: samples[:, POSE]})
    problem = _leaving(followers(links, name), where, room)
    if problem is not None:
        return problem
    for moved in (name, *followers(links, name)):
        for other, place in unrelated.items():
            problem = room.too_close(moved, where[moved], other, place) if moved in where else None
            if problem is not None:
                return problem
    return None


def _leaving(names: Iterable[str], where: Mapping[str, Array], room: Room) -> str | None:
    for moved in names:
        problem = room.outside(where[moved]) if moved in where else None
        if problem is not None:
            return f"{moved} would leave: {problem}"
    return None
