"""rcopterx: formation flight of miniature helicopters. `Fleet` is the scripting interface."""

from ground_station.fleet import Fleet, NotReachedError, RefusedError, Vehicle, VehicleState

__all__ = ["Fleet", "NotReachedError", "RefusedError", "Vehicle", "VehicleState"]
