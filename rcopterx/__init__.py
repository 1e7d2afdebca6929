"""Formation flight of miniature helicopters; `Fleet` is the scripting interface.

Names are imported on first use, so that `rcopterx kill` starts without numerical libraries.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rcopterx.control.references.path_shapes import circle, figure_eight, spiral, through
    from rcopterx.control.references.paths import FlightPath, PathError
    from rcopterx.ground_station.scripting.asynchronous import AsyncFleet, AsyncVehicle
    from rcopterx.ground_station.scripting.fleet import Fleet
    from rcopterx.ground_station.scripting.launched import launched
    from rcopterx.ground_station.scripting.state import VehicleState
    from rcopterx.ground_station.scripting.vehicle import RefusedError, Vehicle
    from rcopterx.ground_station.scripting.waiting import NotReachedError

__all__ = [
    "AsyncFleet",
    "AsyncVehicle",
    "Fleet",
    "FlightPath",
    "NotReachedError",
    "PathError",
    "RefusedError",
    "Vehicle",
    "VehicleState",
    "circle",
    "figure_eight",
    "launched",
    "spiral",
    "through",
]

_MODULES = {
    "AsyncFleet": "rcopterx.ground_station.scripting.asynchronous",
    "AsyncVehicle": "rcopterx.ground_station.scripting.asynchronous",
    "Fleet": "rcopterx.ground_station.scripting.fleet",
    "FlightPath": "rcopterx.control.references.paths",
    "NotReachedError": "rcopterx.ground_station.scripting.waiting",
    "PathError": "rcopterx.control.references.paths",
    "RefusedError": "rcopterx.ground_station.scripting.vehicle",
    "Vehicle": "rcopterx.ground_station.scripting.vehicle",
    "VehicleState": "rcopterx.ground_station.scripting.state",
    "circle": "rcopterx.control.references.path_shapes",
    "figure_eight": "rcopterx.control.references.path_shapes",
    "launched": "rcopterx.ground_station.scripting.launched",
    "spiral": "rcopterx.control.references.path_shapes",
    "through": "rcopterx.control.references.path_shapes",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)
