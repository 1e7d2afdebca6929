"""rcopterx: formation flight of miniature helicopters. `Fleet` is the scripting interface.

Names are imported when they are first used, so that `rcopterx kill` starts without numerical libraries.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rcopterx.agents.references.path_shapes import circle, figure_eight, spiral, through
    from rcopterx.agents.references.paths import FlightPath, PathError
    from rcopterx.ground_station.asynchronous import AsyncFleet, AsyncVehicle
    from rcopterx.ground_station.fleet import Fleet
    from rcopterx.ground_station.launched import launched
    from rcopterx.ground_station.state import VehicleState
    from rcopterx.ground_station.vehicle import RefusedError, Vehicle
    from rcopterx.ground_station.waiting import NotReachedError

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
    "AsyncFleet": "rcopterx.ground_station.asynchronous",
    "AsyncVehicle": "rcopterx.ground_station.asynchronous",
    "Fleet": "rcopterx.ground_station.fleet",
    "FlightPath": "rcopterx.agents.references.paths",
    "NotReachedError": "rcopterx.ground_station.waiting",
    "PathError": "rcopterx.agents.references.paths",
    "RefusedError": "rcopterx.ground_station.vehicle",
    "Vehicle": "rcopterx.ground_station.vehicle",
    "VehicleState": "rcopterx.ground_station.state",
    "circle": "rcopterx.agents.references.path_shapes",
    "figure_eight": "rcopterx.agents.references.path_shapes",
    "launched": "rcopterx.ground_station.launched",
    "spiral": "rcopterx.agents.references.path_shapes",
    "through": "rcopterx.agents.references.path_shapes",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)
