"""What the problems of one control step of the cascade depend on."""

from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import ANY_MATRIX, ANY_VECTOR, VECTOR, record
from rcopterx.control.controllers.settings import Limits
from rcopterx.control.interfaces import Estimate
from rcopterx.control.models.prediction import ESTIMATE
from rcopterx.vehicles.state import Array

RECOVERY_S: Final = 0.2
"""Time constant with which a velocity measured beyond its limits returns to them.

By noise and gusts a vehicle that flies along a limit is beyond it half of the time, and to be back at the
next stage would take a stick from stop to stop.
"""


def recovery(period_s: float, stages: int) -> Array:
    """Return the share of an excess over velocity limits that is left at every stage, shape (N,)."""
    return np.exp(-period_s / RECOVERY_S * np.arange(float(stages)))


class CascadeTask(NamedTuple):
    """One control step of N planned inputs."""

    estimate: Estimate
    load: Array  # accelerations that sticks balance: `Estimate.disturbance`, and gravity; shape (4,)
    reference: Array  # samples, shape (N + 1, 12)
    limits: Limits
    recovery: Array  # share of an excess over velocity limits that is left at every stage, shape (N,)


LIMITS: Final[Any] = record(Limits, *2 * [ANY_MATRIX], *2 * [ANY_VECTOR])
TASK: Final[Any] = record(CascadeTask, ESTIMATE, VECTOR, ANY_MATRIX, LIMITS, VECTOR)
