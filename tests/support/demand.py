"""The demand of sticks, as docs/helicopter.md defines it."""

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array, heading_matrix


def demand_matrix(model: Model, yaw_rad: float) -> Array:
    """R(psi) b: demand [m/s^2] per pitch and roll stick, shape (2, 2)."""
    return np.asarray(heading_matrix(yaw_rad) * model.b[:2])
