"""Bounds that the cascade plans with, and what the problems of one control step depend on."""

from typing import Final, NamedTuple

import numpy as np

from rcopterx.control.controllers.settings import Limits
from rcopterx.control.interfaces import Estimate, LimitScale
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import XD_BODY, YAW_RATE, Array

NARROWEST: Final = 0.01
"""Range of an input that is still worth planning with."""
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
    share: Array
    """Sticks around hovering that are left once the disturbance is balanced; infinite where all are."""

    @classmethod
    def scaled(cls, model: Model, limits: Limits, scale: LimitScale) -> "PlanLimits":
        """Return a vehicle's limits, with velocities and the share of the sticks scaled."""
        sticks = np.array((limits.input_min, limits.input_max))
        states = np.array((limits.state_min, limits.state_max))
        fraction = np.array(scale.inputs)
        share = np.where(fraction < 1.0, fraction, np.inf) * (sticks - model.hover_input)
        positions = np.column_stack((states[:, :3], (-np.inf, np.inf)))
        return cls(positions, states[:, 3:] * np.array(scale.rates), sticks, share)

    def bounds(self, motion: Array, balance: Array, recovery: Array) -> Bounds:
        """Return the bounds of a control step.

        A velocity measured beyond its limits returns to them with `RECOVERY_S`: by noise and gusts a vehicle
        that flies along a limit is beyond it half of the time, and to be back at the next stage would take a
        stick from stop to stop. Where balancing leaves less than `NARROWEST` of the share of a stick, the
        whole range counts.

        Parameters
        ----------
        motion
            Estimated motion state, shape (8,).
        balance
            Sticks that balance the disturbance, shape (4,).
        recovery
            Share of an excess that is left at every stage, shape (N, 1).
        """
        measured = motion[XD_BODY : YAW_RATE + 1]
        below = np.minimum(measured - self.velocity[0], 0.0)
        above = np.maximum(measured - self.velocity[1], 0.0)
        low = np.maximum(self.input[0], self.share[0] - balance)
        high = np.minimum(self.input[1], self.share[1] - balance)
        return Bounds(
            self.position,
            self.velocity[0] + recovery * below,
            self.velocity[1] + recovery * above,
            np.where(high - low > NARROWEST, (low, high), self.input),
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
