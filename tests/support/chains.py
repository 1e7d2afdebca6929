"""Chains that tests of several packages solve problems of."""

import numpy as np

from rcopterx.control.controllers.chains.chain import ChainParameters
from rcopterx.vehicles.types import COAXIAL

PERIOD_S = 0.02


def coaxial_lateral(stages: int, clearances: int = 0) -> ChainParameters:
    """Of the horizontal problem of a coaxial helicopter, with as many stages and rows of clearance."""
    return ChainParameters(
        stages,
        PERIOD_S,
        COAXIAL.b[:2],
        None,
        np.zeros(2),
        np.full(2, 100.0),
        np.ones(2),
        np.full(2, 3.0),
        1e4,
        (True, True),
        clearances,
    )
