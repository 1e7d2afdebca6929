"""Inputs as they are sent: rounded before anybody uses them, so that estimator, log and radio agree."""

from typing import Final

import numpy as np

from rcopterx.native.motion import whole_units
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

INPUT_UNIT: Final = 2.0**-12
"""An eighth of the steps of the finest radio; a binary fraction, which flight logs hold in few bytes."""


def as_sent(inputs: Array, model: Model) -> Array:
    """Inputs in whole `INPUT_UNIT`, but for those at the limits of the vehicle; shape (k, 4)."""
    whole = np.empty(inputs.shape)
    whole_units(inputs, model.u_min, model.u_max, INPUT_UNIT, whole)
    return whole
