"""Inputs as they are sent: rounded first, so that estimator, log and radio agree."""

from typing import Final

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

INPUT_UNIT: Final = 2.0**-12
"""An eighth of the steps of the finest radio; a binary fraction, which flight logs hold in few bytes."""


def as_sent(inputs: Array, model: Model) -> Array:
    """Return inputs, shape (k, 4), in whole `INPUT_UNIT`, but for those at the limits of the vehicle."""
    return np.clip(np.rint(inputs / INPUT_UNIT) * INPUT_UNIT, model.u_min, model.u_max)
