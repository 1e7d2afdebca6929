"""Vehicles of a file at their positions as a formation of a fleet file."""

from collections.abc import Sequence
from pathlib import Path

from rcopterx.deploy.new_laboratory import NewVehicle, name_of
from rcopterx.fleet.schema import FleetError


def formation_of(source: Path, placed: Sequence[NewVehicle], prefix: str) -> list[NewVehicle]:
    """Return vehicles at positions `offset_m` as a formation behind the first one; empty ports: simulated.

    Names get small letters, and the prefix unless a letter is first. `FleetError` if two are the same then.
    """
    vehicles = []
    for vehicle in placed:
        name = name_of(vehicle.name)
        name = name if name[:1].isalpha() else f"{prefix}{name}"
        apart = zip(vehicle.offset_m or (), placed[0].offset_m or (), strict=True)
        x, y, z = (round(float(own - of_first), 4) for own, of_first in apart)
        vehicles.append(vehicle._replace(name=name, port=vehicle.port or f"radio-{name}", offset_m=(x, y, z)))
    if len({vehicle.name for vehicle in vehicles}) < len(vehicles):
        raise FleetError(f"{source}: names of vehicles differ only in capital letters or signs")
    return vehicles
