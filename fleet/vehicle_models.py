"""Models of the vehicles of a fleet file."""

from dataclasses import replace

from rcopterx.fleet.reading import replaced
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.types import TYPES


def model_of(fleet: FleetFile, name: str) -> Model:
    """Return the model of a vehicle: its type, the parameters in the file, and the volume as position bounds.

    Raises `FleetError`: the type or a parameter is unknown.
    """
    vehicle = fleet.vehicles[name]
    where = f"vehicles.{name}"
    if vehicle.type not in TYPES:
        raise FleetError(f"{where}.type: unknown type {vehicle.type!r}, allowed are {', '.join(TYPES)}")
    model = replaced(TYPES[vehicle.type], vehicle.model, f"{where}.model")
    # Set points stay within the volume, which may begin above the floor; flights begin and end on the floor.
    (low_x, low_y, low_z), high = fleet.volume.min_m, fleet.volume.max_m
    return replace(
        model,
        state_min=(low_x, low_y, min(low_z, 0.0), *model.state_min[3:]),
        state_max=(*high, *model.state_max[3:]),
    )
