"""Refuses formations that do not fit into the flight volume or bring vehicles too close together."""

from itertools import combinations

import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.formation.placement import TOLERANCE_M, Room
from rcopterx.formation.topology import places, roots
from rcopterx.vehicles.state import Array


def links_of(fleet: FleetFile) -> dict[str, tuple[LeaderLink, ...]]:
    """Return the leaders of every vehicle."""
    return {name: tuple(vehicle.follow) for name, vehicle in fleet.vehicles.items()}


def formation_places(fleet: FleetFile) -> dict[str, Array]:
    """Return x, y, z [m] and yaw [rad] of every vehicle, in formations whose heads are at the origin."""
    links = links_of(fleet)
    return places(links, {name: np.zeros(4) for name, own in links.items() if not own})


def check_formation(fleet: FleetFile, minimum_distance_m: float | None) -> None:
    """Check distances and room of each formation at heading zero; raises `FleetError`."""
    links, where = links_of(fleet), formation_places(fleet)
    room = Room(fleet.volume.min_m, fleet.volume.max_m, minimum_distance_m)
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
