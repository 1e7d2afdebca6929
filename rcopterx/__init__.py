"""rcopterx: formation flight of miniature helicopters. `Fleet` is the scripting interface.

Names are imported when they are first used, so that `rcopterx kill` starts without numerical libraries.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agents.references.path_shapes import circle, figure_eight, spiral, through
    from agents.references.paths import FlightPath, PathError
    from ground_station.asynchronous import AsyncFleet, AsyncVehicle
    from ground_station.fleet import Fleet
    from ground_station.launched import launched
    from ground_station.state import VehicleState
    from ground_station.vehicle import RefusedError, Vehicle
    from ground_station.waiting import NotReachedError

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
    "AsyncFleet": "ground_station.asynchronous",
    "AsyncVehicle": "ground_station.asynchronous",
    "Fleet": "ground_station.fleet",
    "FlightPath": "agents.references.paths",
    "NotReachedError": "ground_station.waiting",
    "PathError": "agents.references.paths",
    "RefusedError": "ground_station.vehicle",
    "Vehicle": "ground_station.vehicle",
    "VehicleState": "ground_station.state",
    "circle": "agents.references.path_shapes",
    "figure_eight": "agents.references.path_shapes",
    "launched": "ground_station.launched",
    "spiral": "agents.references.path_shapes",
    "through": "agents.references.path_shapes",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)
