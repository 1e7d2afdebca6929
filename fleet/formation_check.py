"""Refuses formations that do not fit into the room, or bring vehicles too close together."""

from itertools import combinations
from typing import Final

import numpy as np

from rcopterx.bus.message import Four
from rcopterx.bus.messages import LeaderLink
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.fleet.vehicle_models import limits_of
from rcopterx.formation.placement import TOLERANCE_M, Room
from rcopterx.formation.topology import places, roots
from rcopterx.vehicles.state import Array

ABOVE_M: Final = 1.0  # usual height of take-offs


def links_of(fleet: FleetFile) -> dict[str, tuple[LeaderLink, ...]]:
    """Return the leaders of every vehicle."""
    return {name: tuple(vehicle.follow) for name, vehicle in fleet.vehicles.items()}


def formation_places(fleet: FleetFile) -> dict[str, Array]:
    """Return x, y, z [m] and yaw [rad] of all vehicles and subjects; heads and subjects are at the origin."""
    links = links_of(fleet)
    heads = (*fleet.subjects, *(name for name, own in links.items() if not own))
    return places(links, dict.fromkeys(heads, np.zeros(4)))


def start_places(fleet: FleetFile) -> dict[str, Four]:
    """Return x, y, z [m] and yaw [rad] at which vehicles and subjects of a simulated fleet stand at first."""
    places_m = {name: place.tolist() for name, place in formation_places(fleet).items()}
    starts = {name: (x, y, 0.0, yaw_rad) for name, (x, y, _, yaw_rad) in places_m.items()}
    return starts | (fleet.simulator.start if fleet.simulator else {})


def room_of(fleet: FleetFile, name: str | None = None) -> Room:
    """Return what a vehicle, by default the first one, has to stay within and out of."""
    distance_m = limits_of(fleet, name or next(iter(fleet.vehicles))).surveillance.minimum_distance_m
    return Room(fleet.volume.min_m, fleet.volume.max_m, distance_m, fleet.zones)


def check_formation(fleet: FleetFile, room: Room) -> None:
    """Check distances and room of each formation at heading zero; raises `FleetError`."""
    links, where = links_of(fleet), formation_places(fleet)
    if fleet.simulator is not None:
        _check_zones(fleet, room)
    for name, other in combinations(fleet.vehicles, 2):
        if roots(links, name) != roots(links, other):
            continue
        later = name if links[name] and any(link.leader == other for link in links[name]) else other
        problem = room.too_close(name, where[name], other, where[other])
        if problem is not None:
            raise FleetError(f"vehicles.{later}.follow: {problem}")
        gap = np.abs(where[name][:3] - where[other][:3])
        for axis, (low, high) in enumerate(zip(fleet.volume.min_m, fleet.volume.max_m, strict=True)):
            if gap[axis] > high - low + TOLERANCE_M:
                raise FleetError(
                    f"vehicles.{later}.follow: {name} and {other} would be {gap[axis]:.3g} m apart in "
                    f"{'xyz'[axis]}, the flight volume is {high - low:g} m there"
                )


def _check_zones(fleet: FleetFile, room: Room) -> None:
    """Refuse places in zones at which vehicles stand at first, or fly after a take-off to `ABOVE_M`."""
    starts = {name: np.array(start) for name, start in start_places(fleet).items()}
    up = np.array([0.0, 0.0, ABOVE_M, 0.0])
    above = places(links_of(fleet), {name: start + up for name, start in starts.items()})
    for name in fleet.vehicles:
        for what, place in (("stands", starts[name]), ("flies in formation", above[name])):
            if (problem := room.barred(place)) is not None:
                raise FleetError(f"vehicles.{name}: where it {what}: {problem}")
