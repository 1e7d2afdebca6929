"""Bounds that the cascade plans with."""

from typing import Final, NamedTuple

import numpy as np

from rcopterx.control.controllers.settings import Limits
from rcopterx.control.interfaces import LimitScale
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

NARROWEST: Final = 0.01
"""Range of an input that is still worth planning with."""
RECOVERY_S: Final = 0.2
"""Time constant with which a velocity beyond its bounds returns to them."""


class PlanLimits(NamedTuple):
    """Lower and upper bounds of the axes x, y, z, yaw; every array has shape (2, 4)."""

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

    def sticks(self, axes: slice, balance: Array) -> Array:
        """Return the bounds of sticks that balance a disturbance, shape (2, m).

        Where the balance leaves less than `NARROWEST` of the share, the whole range counts.
        """
        whole, shared = self.input[:, axes], self.share[:, axes] - balance
        narrowed = np.array((np.maximum(whole[0], shared[0]), np.minimum(whole[1], shared[1])))
        return np.where(narrowed[1] - narrowed[0] > NARROWEST, narrowed, whole)

    def velocities(self, axes: slice, measured: Array, recovery: Array) -> Array:
        """Return the bounds of velocities, shape (2, N, m).

        A velocity measured beyond its bounds returns to them with `RECOVERY_S`: by noise and gusts a vehicle
        that flies along a bound is beyond it half of the time, and to be back at the next stage would take a
        stick from stop to stop.
        """
        low, high = self.velocity[:, axes]
        return np.array(
            (
                low + recovery * np.minimum(measured - low, 0.0),
                high + recovery * np.maximum(measured - high, 0.0),
            )
        )


def recovery(period_s: float, stages: int) -> Array:
    """Return the share of an excess over velocity bounds that is left at every stage, shape (N, 1)."""
    return np.exp(-period_s / RECOVERY_S * np.arange(float(stages)))[:, None]
