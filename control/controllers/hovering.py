"""The feedback law that is left when no controller has anything to offer: come to rest at a place."""

from typing import Final

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import XD_BODY, YAW, Array, heading_matrix

_STIFFNESS: Final = np.array([2.0, 2.0, 4.0, 9.0])
_DAMPING: Final = np.array([2.5, 2.5, 4.0, 6.0])
_ERROR_CAP: Final = np.array([0.4, 0.4, 0.4, 0.8])


def hovering_input(model: Model, motion: Array, set_point: Array) -> Array:
    """Input that brings a vehicle to rest at a place, not limited; shape (4,).

    Parameters
    ----------
    model
        The vehicle.
    motion
        Motion state, shape (8,).
    set_point
        x, y, z [m], yaw [rad].
    """
    error = np.clip(motion[:4] - set_point, -_ERROR_CAP, _ERROR_CAP)
    error[:2] = heading_matrix(float(motion[YAW])).T @ error[:2]
    acceleration = -_STIFFNESS * error - _DAMPING * motion[XD_BODY:]
    return np.asarray(model.hover_input + acceleration / model.b)
