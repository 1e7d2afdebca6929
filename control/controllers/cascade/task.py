"""Limits that the cascade plans with, and what the problems of one control step depend on."""

from typing import Any, Final, NamedTuple

import numpy as np

from rcopterx.compiling.compiled import ANY_MATRIX, VECTOR, record
from rcopterx.control.controllers.settings import Limits
from rcopterx.control.interfaces import Estimate
from rcopterx.control.models.finite import ESTIMATE
from rcopterx.vehicles.state import Array

RECOVERY_S: Final = 0.2
"""Time constant with which a velocity measured beyond its limits returns to them.

By noise and gusts a vehicle that flies along a limit is beyond it half of the time, and to be back at the
next stage would take a stick from stop to stop.
"""


class PlanLimits(NamedTuple):
    """Limits of the axes x, y, z, yaw; every array has shape (2, 4): lower, upper."""

    position: Array  # inertial frame; infinite for the heading
    velocity: Array  # body frame
    input: Array  # sticks

    @classmethod
    def of(cls, limits: Limits) -> "PlanLimits":
        """Return the limits of a vehicle by axes."""
        states = np.array((limits.state_min, limits.state_max))
        positions = np.column_stack((states[:, :3], (-np.inf, np.inf)))
        return cls(positions, states[:, 3:], np.array((limits.input_min, limits.input_max)))


def recovery(period_s: float, stages: int) -> Array:
    """Return the share of an excess over velocity limits that is left at every stage, shape (N,)."""
    return np.exp(-period_s / RECOVERY_S * np.arange(float(stages)))


class Task(NamedTuple):
    """One control step of N planned inputs."""

    estimate: Estimate
    load: Array  # accelerations that sticks balance: `Estimate.disturbance`, and gravity; shape (4,)
    reference: Array  # samples, shape (N + 1, 12)
    limits: PlanLimits
    recovery: Array  # share of an excess over velocity limits that is left at every stage, shape (N,)


TASK: Final[Any] = record(Task, ESTIMATE, VECTOR, ANY_MATRIX, record(PlanLimits, *3 * [ANY_MATRIX]), VECTOR)
