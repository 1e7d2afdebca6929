"""Refusal of places and ways that leave the volume, enter a zone, or are too close to another vehicle."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from rcopterx.bus.messages import AgentStatus, LeaderLink, Zone, ZoneSet
from rcopterx.formation.topology import AT_WORK, FormationGraph, Places, followers, formation_of, places
from rcopterx.vehicles.state import Array, three
from rcopterx.vehicles.tuples import Three

TOLERANCE_M: Final = 1e-6  # a way that only touches a zone does not enter it
EVERY_M: Final = 0.01  # between places that are tried, on the straight lines between those of a way


def after_leaving(within: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which of these places count, of a way that may begin so, but has to end otherwise."""
    counted: NDArray[np.bool_] = within & ~np.append(np.logical_and.accumulate(within)[:-1], False)
    return counted


def entered(zone: Zone, way_m: Array) -> Array | None:
    """Return where, shape (3,), a way, shape (k, 3), enters a zone with its margin; None if it does not.

    A way that begins in the margin may leave it, but not through the zone itself.
    """
    low_m, high_m = np.array(zone.min_m), np.array(zone.max_m)
    reach_m = zone.margin_m - TOLERANCE_M
    # Only steps near the zone count: a leader tries the ways of all followers within a control period.
    ends_m = np.vstack((way_m[1:], way_m[-1:]))
    below, above = np.minimum(way_m, ends_m) <= high_m + reach_m, np.maximum(way_m, ends_m) >= low_m - reach_m
    near = np.flatnonzero(np.all(below & above, axis=1))
    if not len(near):
        return None
    way_m = way_m[near[0] : near[-1] + 2]
    passed_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(way_m, axis=0), axis=1)))
    along_m = np.linspace(0.0, passed_m[-1], 2 + int(passed_m[-1] / EVERY_M))
    places_m = np.column_stack([np.interp(along_m, passed_m, axis_m) for axis_m in way_m.T])
    beside_m = np.abs(places_m - (low_m + high_m) / 2)
    if zone.shape == "cylinder":
        beside_m[:, :2] = np.linalg.norm(beside_m[:, :2], axis=1, keepdims=True)
    half_m = (high_m - low_m) / 2
    in_margin, in_zone = (np.all(beside_m < half_m + by_m, axis=1) for by_m in (reach_m, -TOLERANCE_M))
    inside = after_leaving(in_margin) | after_leaving(in_zone)
    return places_m[np.argmax(inside)] if inside.any() else None


@dataclass(frozen=True)
class Room:
    """What vehicles have to stay within, and out of."""

    min_m: Three
    max_m: Three  # flight volume, inertial frame
    minimum_distance_m: float | None = 0.3  # smallest distance between two vehicles; None for no limit
    zones: Mapping[str, Zone] = field(default_factory=dict)  # keep-out zones by name

    def shrunk(self, by_m: float, begins_m: Sequence[Array] = ()) -> "Room":
        """Return the room for what reaches so far from a place; zones so near to a beginning stay."""
        low_m, high_m = np.array(self.min_m) + by_m, np.array(self.max_m) - by_m
        zones = {name: structs.replace(z, margin_m=z.margin_m + by_m) for name, z in self.zones.items()}
        for name, zone in self.zones.items():
            if any(entered(zones[name], at_m[None, :3]) is not None for at_m in begins_m):
                zones[name] = zone
        return replace(self, min_m=three(low_m), max_m=three(high_m), zones=zones)

    def with_beside(self, offsets_m: Iterable[Array]) -> "Room":
        """Return the room of a vehicle whose followers, at these offsets, shape (3,), stay in this one."""
        low_m, high_m, zones = np.array(self.min_m), np.array(self.max_m), dict(self.zones)
        for number, offset_m in enumerate(offsets_m):
            low_m = np.maximum(low_m, self.min_m - offset_m)
            high_m = np.minimum(high_m, self.max_m - offset_m)
            for name, zone in self.zones.items():
                corners = {"min_m": three(zone.min_m - offset_m), "max_m": three(zone.max_m - offset_m)}
                zones[f"{name} {number}"] = structs.replace(zone, **corners)
        return replace(self, min_m=three(low_m), max_m=three(high_m), zones=zones)

    def barred(self, way: Array) -> str | None:
        """Name the keep-out zone that a place, x y z first, or a way enters, as `entered`; None if none."""
        for name, zone in self.zones.items():
            at_m = entered(zone, np.atleast_2d(way)[:, :3])
            if at_m is not None:
                where = ", ".join(f"{value:.2f}" for value in at_m)
                return f"({where}) m is not {zone.margin_m:g} m clear of the keep-out zone {name}"
        return None

    def outside(self, way: Array) -> str | None:
        """Describe how a place, x y z first, or a way leaves the room, or stays outside; None if neither."""
        places_m = np.atleast_2d(way)[:, :3]
        beyond_m = np.maximum(np.array(self.min_m) - places_m, places_m - np.array(self.max_m))
        out = after_leaving(beyond_m.max(axis=1) > TOLERANCE_M)
        if not out.any():
            return self.barred(way)
        place, axis = divmod(int(np.argmax(beyond_m * out[:, None])), 3)
        return (
            f"{'xyz'[axis]}: {places_m[place, axis]:.4g} m is outside the flight volume "
            f"{self.min_m[axis]:g} .. {self.max_m[axis]:g} m"
        )

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


class PresentRoom:
    """The room of a vehicle at present: its keep-out zones change in flight."""

    def __init__(self, room: Room) -> None:
        self.now = room
        self.zones: ZoneSet | None = None  # that replace those of the fleet file; None until one is changed

    def adopt(self, known: Iterable[ZoneSet | None]) -> bool:
        """Adopt the latest of these sets of zones if the present one is older; return whether it was."""
        latest = max(filter(None, (self.zones, *known)), key=lambda zones: zones.revision, default=None)
        if latest is None or latest is self.zones:
            return False
        self.zones, self.now = latest, replace(self.now, zones=latest.zones)
        return True


def offset_problem(name: str, following: tuple[LeaderLink, ...], room: Room) -> str | None:
    """Return why an offset is too small; None if it is not, and for several leaders, whose places count."""
    if len(following) != 1:
        return None
    return room.too_close(name, np.array(following[0].offset_m), following[0].leader, np.zeros(3))


def place_problem(
    name: str, following: tuple[LeaderLink, ...], links: FormationGraph, heads: Places, room: Room
) -> str | None:
    """Return why a vehicle cannot follow its new leaders, None if it can; its followers come along.

    `heads`: places of vehicles that lead, and the present one of this vehicle.
    """
    after = {**links, name: following}
    where, before = places(after, heads), places({**links, name: ()}, heads)
    if name not in where:
        return None
    along = followers(after, name)
    problem = _leaving((name, *along), where, room, before)
    pairs = [(name, other) for other in where if other != name]
    pairs += [(moved, other) for moved in along if moved in where for other in where if other not in along]
    close = (room.too_close(moved, where[moved], other, where[other]) for moved, other in pairs)
    return problem or next(filter(None, close), None)


def take_off_problem(
    name: str,
    floor_m: Array,
    height_m: float,
    following: tuple[LeaderLink, ...],
    statuses: Mapping[str, AgentStatus],
    room: Room,
) -> str | None:
    """Return why the column above a place, or the place beside leaders in the air, is not free, or None."""
    top_m = np.array([*floor_m[:2], floor_m[2] + height_m])
    if (problem := room.barred(np.array([floor_m, top_m, floor_m]))) is not None:
        return f"on its way up {problem}"
    for other, status in statuses.items():
        if status.position_m is None or other == name:
            continue
        place = np.array(status.position_m)
        nearest = np.array([*floor_m[:2], np.clip(place[2], floor_m[2], top_m[2])])
        problem = room.too_close(name, nearest, other, place)
        if problem is not None:
            return f"on its way up {problem}"
    if not all(link.leader in statuses and statuses[link.leader].phase in AT_WORK for link in following):
        return None
    others = {other: status for other, status in statuses.items() if other != name}
    links, heads = formation_of(others, flying=(name,))
    return place_problem(name, following, links, heads | {name: np.append(top_m, 0.0)}, room)


def move_problem(
    name: str, way: Array, links: FormationGraph, heads: Places, room: Room, unrelated: Places
) -> str | None:
    """Return why a vehicle that leads cannot go a way, None if it can; its followers come along.

    `way`: its places in future, x, y, z [m], yaw [rad], shape (k, 4). `heads`: places of other leaders, shape
    (4,). `unrelated`: places of others, x y z first, which do not avoid its plan.
    """
    where = places({**links, name: ()}, {**heads, name: way})
    problem = room.outside(way) or _leaving(followers(links, name), where, room, {})
    along = [moved for moved in (name, *followers(links, name)) if moved in where]
    close = (room.too_close(moved, where[moved], *other) for moved in along for other in unrelated.items())
    return problem or next(filter(None, close), None)


def _leaving(names: Iterable[str], where: Places, room: Room, before: Places) -> str | None:
    for moved in names:
        if moved in where:
            way = where[moved] if moved not in before else np.array([before[moved], where[moved]])
            if (problem := room.outside(way)) is not None:
                return f"no place for {moved}: {problem}"
    return None
