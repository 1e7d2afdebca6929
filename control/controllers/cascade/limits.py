"""Bounds that the cascade plans with, and what the problems of one control step depend on."""

from typing import Final, NamedTuple

import numpy as np

from rcopterx.control.controllers.settings import Limits
from rcopterx.control.interfaces import Estimate
from rcopterx.vehicles.state import XD_BODY, YAW_RATE, Array

RECOVERY_S: Final = 0.2
"""Time constant with which a velocity beyond its bounds returns to them."""


class Bounds(NamedTuple):
    """Lower and upper bounds of one control step for the axes x, y, z, yaw."""

    position: Array
    """Inertial frame, shape (2, 4); infinite for the heading."""
    lowest_velocity: Array
    highest_velocity: Array
    """Body frame, shape (N, 4)."""
    stick: Array
    """Shape (2, 4)."""


class PlanLimits(NamedTuple):
    """Limits of the axes x, y, z, yaw; every array has shape (2, 4): lower, upper."""

    position: Array
    """Inertial frame; infinite for the heading."""
    velocity: Array
    """Body frame."""
    input: Array
    """Sticks."""

    @classmethod
    def of(cls, limits: Limits) -> "PlanLimits":
        """Return the limits of a vehicle by axes."""
        states = np.array((limits.state_min, limits.state_max))
        positions = np.column_stack((states[:, :3], (-np.inf, np.inf)))
        return cls(positions, states[:, 3:], np.array((limits.input_min, limits.input_max)))

    def bounds(self, motion: Array, recovery: Array) -> Bounds:
        """Return the bounds of a control step.

        A velocity measured beyond its limits returns to them with `RECOVERY_S`: by noise and gusts a vehicle
        that flies along a limit is beyond it half of the time, and to be back at the next stage would take a
        stick from stop to stop.

        Parameters
        ----------
        motion
            Estimated motion state, shape (8,).
        recovery
            Share of an excess that is left at every stage, shape (N, 1).
        """
        measured = motion[XD_BODY : YAW_RATE + 1]
        below = np.minimum(measured - self.velocity[0], 0.0)
        above = np.maximum(measured - self.velocity[1], 0.0)
        return Bounds(
            self.position,
            self.velocity[0] + recovery * below,
            self.velocity[1] + recovery * above,
            self.input,
        )


def recovery(period_s: float, stages: int) -> Array:
    """Return the share of an excess over velocity limits that is left at every stage, shape (N, 1)."""
    return np.exp(-period_s / RECOVERY_S * np.arange(float(stages)))[:, None]


class Task(NamedTuple):
    """One control step of N planned inputs."""

    estimate: Estimate
    load: Array
    """Accelerations that sticks balance: `Estimate.disturbance`, and gravity; shape (4,)."""
    reference: Array
    """Samples, shape (N + 1, 12)."""
    bounds: Bounds
