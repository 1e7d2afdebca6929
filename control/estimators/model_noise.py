"""How far a filter lets a vehicle depart from its model: what the process noise is for.

A filter that believes a wrong model is what makes a loop oscillate, before any weight does: it takes what
rotors do late for wind, and the controller answers it. So rates and actuators of a vehicle with a tilt model
of which only the type is known may wander, and its filter follows the measurements.
"""

from dataclasses import dataclass

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.tuples import Four


@dataclass(frozen=True, slots=True)
class ModelNoise:
    """Defaults of the settings of the extended Kalman filter; body x, body y, z, yaw.

    Attributes
    ----------
    velocity
        Random-walk density of velocities and yaw rate [m/s, rad/s per root second].
    actuator
        Random-walk density of the actuator states [1 per root second].
    disturbance_limit
        Largest disturbances that are believed [m/s^2, rad/s^2]; that of the height holds what the thrust
        gain may be wrong.
    tilt
        Random-walk density of the tilt rate [rad/s per root second].
    """

    velocity: Four
    actuator: Four
    disturbance_limit: Four
    tilt: float


def model_noise(model: Model) -> ModelNoise:
    """What the uncertainty of a model lets expect; without a tilt model it is that of an identified one."""
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
