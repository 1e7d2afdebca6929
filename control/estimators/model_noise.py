"""Process noise of the extended Kalman filter by the uncertainty of the model.

A filter that believes a wrong model makes a loop oscillate: it takes the late response of the rotors for
wind, and the controller answers that. So a vehicle with a tilt model of which only the type is known has much
process noise in rates and actuators, and its filter follows the measurements.
"""

from dataclasses import dataclass

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.tuples import Four


@dataclass(frozen=True, slots=True)
class ModelNoise:
    """Defaults of the settings of the extended Kalman filter; body x, body y, z, yaw."""

    velocity: Four
    """Random-walk density of velocities and yaw rate [m/s, rad/s per root second]."""
    actuator: Four
    """Random-walk density of the actuator states [1 per root second]."""
    disturbance_limit: Four
    """Limits of the disturbances [m/s^2, rad/s^2]; that of the height covers errors of the thrust gain."""
    tilt: float
    """Random-walk density of the tilt rate [rad/s per root second]."""


def model_noise(model: Model) -> ModelNoise:
    """Return the noise for the uncertainty of a model; without a tilt model that of an identified one."""
    graded = model.uncertainty.graded
    if model.tilt is None:
        return ModelNoise(
            (0.01, 0.01, 0.01, 0.05), (0.02, 0.02, 0.01, 0.01), (2.0, 2.0, 2.5, 15.0), graded(2.1, 4.9)
        )
    return ModelNoise(
        velocity=(graded(0.01, 0.05), graded(0.01, 0.05), graded(0.01, 0.06), graded(0.05, 1.5)),
        actuator=(0.02, 0.02, graded(0.01, 0.06), graded(0.01, 0.2)),
        disturbance_limit=(2.0, 2.0, graded(2.5, 5.0), 15.0),
        tilt=graded(2.1, 4.9),
    )
