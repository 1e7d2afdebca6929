"""rcopterx: formation flight of miniature helicopters. `Fleet` is the scripting interface."""

from ground_station.fleet import Fleet, RefusedError, Vehicle
from ground_station.state import VehicleState
from ground_station.waiting import NotReachedError

__all__ = ["Fleet", "NotReachedError", "RefusedError", "Vehicle", "VehicleState"]
