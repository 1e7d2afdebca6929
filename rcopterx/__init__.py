"""rcopterx: formation flight of miniature helicopters. `Fleet` is the scripting interface."""

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
