"""Models of vehicle types that come with the package."""

from rcopterx.fleet.vehicle_types import vehicle_type

COAXIAL = vehicle_type("coaxial").model
COAXIAL_LAG = vehicle_type("coaxial_lag").model
CRAZYFLIE = vehicle_type("crazyflie").model
QUADROTOR = vehicle_type("quadrotor").model
TYPES = {model.kind: model for model in (COAXIAL, COAXIAL_LAG, QUADROTOR)}
"""One type of each airframe."""
