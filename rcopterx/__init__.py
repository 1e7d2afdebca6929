"""Formation flight of miniature helicopters; names are imported on first use, for a quick `kill`."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rcopterx.bus.messages import Zone
    from rcopterx.control.references.path_shapes import circle, figure_eight, spiral, through
    from rcopterx.control.references.paths import FlightPath, PathError
    from rcopterx.ground_station.scripting.fleet import Fleet
    from rcopterx.ground_station.scripting.launched import launched
    from rcopterx.ground_station.scripting.state import VehicleState
    from rcopterx.ground_station.scripting.vehicle import RefusedError, Vehicle
    from rcopterx.ground_station.scripting.waiting import NotReachedError

__all__ = [
    "Fleet", "FlightPath", "NotReachedError", "PathError", "RefusedError", "Vehicle", "VehicleState",
    "Zone", "circle", "figure_eight", "launched", "spiral", "through",
]  # fmt: skip

_MODULES = {
    "bus.messages": ("Zone",),
    "control.references.path_shapes": ("circle", "figure_eight", "spiral", "through"),
    "control.references.paths": ("FlightPath", "PathError"),
    "ground_station.scripting.fleet": ("Fleet",),
    "ground_station.scripting.launched": ("launched",),
    "ground_station.scripting.state": ("VehicleState",),
    "ground_station.scripting.vehicle": ("RefusedError", "Vehicle"),
    "ground_station.scripting.waiting": ("NotReachedError",),
}


def __getattr__(name: str) -> object:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
