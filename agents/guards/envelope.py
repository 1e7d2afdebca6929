"""The flight envelope of controllers that are not part of this package: plug-ins and external programs.

Their planned inputs are predicted by the model for as long as a transmitter gateway may play them. From
there the vehicle must be able to come to rest in its volume and clear of others, or touch down softly.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from rcopterx.control.interfaces import Obstacle
from rcopterx.control.references.columns import ACCELERATION, POSITION, VELOCITY, YAW_RATE
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array, Z

BRAKING_SHARE: Final = 0.8  # share of the acceleration that the weakest vehicle of a type surely has
FAST: Final = 1.5  # largest share of the horizontal velocity bounds
SPINNING: Final = 3.0  # the same of the yaw rate, which sharp changes of the thrust move
TOUCHDOWN_M_S: Final = 0.5  # largest speed at which the floor may be reached
TOO_NEAR: Final = 1.0  # smallest distance from another vehicle, in its ellipsoids


class Envelope:
    """What one vehicle may be made to do; the floor is at z = 0."""

    def __init__(self, model: Model, bridged_s: float) -> None:
        self._bridged_s = bridged_s  # for so long planned inputs may act without a further command
        self._braking_m_s2: Array = BRAKING_SHARE * model.sure_reach[[0, 0, 1]]
        self._lag_s: Array = np.array(model.lag_s[:3])
        self._reaction_s: Array = self._lag_s + np.array(model.uncertainty.delay_s)[[0, 0, 1]]
        self._low_m: Array = np.array(model.state_min[:3])
        self._high_m: Array = np.array(model.state_max[:3])
        self._fastest_m_s = FAST * max(model.state_max[3:5])
        self._fastest_rad_s = SPINNING * model.state_max[6]

    def problem(self, plan: Trajectory, obstacles: Sequence[Obstacle]) -> str | None:
        """Return why a predicted trajectory must not be flown; None if it may."""
        stage = min(round(self._bridged_s / plan.period_s), len(plan.samples) - 1)
        sample = plan.samples[stage]
        # The present acceleration fades with the lag of the actuators before braking begins.
        fading = self._lag_s * sample[ACCELERATION]
        velocity = sample[VELOCITY] + fading
        begins = sample[POSITION] + self._reaction_s * velocity
        rests = begins + velocity * np.abs(velocity) / (2.0 * self._braking_m_s2)
        sinking, braking = -min(velocity[Z], 0.0), self._braking_m_s2[Z]
        if sinking**2 - 2.0 * braking * max(begins[Z], 0.0) > TOUCHDOWN_M_S**2:
            return "the vehicle would hit the floor"
        if (rests > self._high_m).any() or (rests[:2] < self._low_m[:2]).any():
            return "the vehicle would leave its volume"
        if np.hypot(*sample[VELOCITY][:2]) > self._fastest_m_s or abs(sample[YAW_RATE]) > self._fastest_rad_s:
            return "the vehicle would be too fast"
        until_rest_s = (self._reaction_s + np.abs(velocity) / self._braking_m_s2).max()
        stages = stage + np.linspace(0.0, until_rest_s / plan.period_s, 3)
        way = np.linspace(sample[POSITION], rests, 3)
        if any(_too_near(way, stages.astype(int), obstacle) for obstacle in obstacles):
            return "the vehicle would come too near another one"
        return None


def _too_near(way_m: Array, stages: Array, obstacle: Obstacle) -> bool:
    """Whether places, shape (k, 3), at stages, shape (k,), are inside the ellipsoid of another vehicle."""
    at = np.minimum(stages, len(obstacle.positions_m) - 1)
    gap = (way_m - obstacle.positions_m[at]) / obstacle.half_axes_m[at]
    return bool(np.linalg.norm(gap, axis=1).min() < TOO_NEAR)
