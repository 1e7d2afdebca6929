"""Limits of the motion of leaders to their set points, so that all vehicles below them can follow.

They limit only what a leader refers to: against disturbances it has all of its sticks. A follower needs the
rest of its own sticks for disturbances, its true gain may be smaller than its model's, and a follower with
another heading may need of one stick alone what the leader's pitch and roll do together.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from rcopterx.control.references.set_points import ProfileLimits
from rcopterx.formation.topology import FormationGraph, followers, places
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import three

SPEED_SHARE: Final = 0.8
ACCELERATION_SHARE: Final = 0.8  # shares of what the weakest follower can surely do
JERK_TIME_S: Final = 0.15  # shortest time in which an acceleration changes by its limit
ARM_SPEED_SHARE: Final = 0.8
ARM_ACCELERATION_SHARE: Final = 0.5  # shares of a follower's limits that a turn of its leader may use
SHORTEST_ARM_M: Final = 0.02


def profile_limits_of(links: FormationGraph, models: Mapping[str, Model], name: str) -> ProfileLimits | None:
    """Return the limits of a vehicle's ways for all vehicles below it, of its own model if unknown."""
    arms = arms_of(links, name)
    rate, acceleration = np.full((2, 3), np.inf)
    for follower in followers(links, name):
        model = models.get(follower, models.get(name))
        if model is None:
            continue
        half = 0.5 * np.subtract(model.state_max, model.state_min)[3:]
        # Horizontal at any heading, vertical, of the heading.
        speeds, reach = np.array([half[:2].min(), *half[2:]]), model.reach
        rate = np.minimum(rate, SPEED_SHARE * speeds)
        acceleration = np.minimum(acceleration, ACCELERATION_SHARE * model.sure_reach)
        arm_m = arms.get(follower, 0.0)
        if arm_m > 0.0:
            rate[2] = min(rate[2], ARM_SPEED_SHARE * speeds[0] / arm_m)
            acceleration[2] = min(acceleration[2], ARM_ACCELERATION_SHARE * reach[0] / arm_m)
    if not np.isfinite(rate).all():
        return None
    return ProfileLimits(three(rate), three(acceleration), three(acceleration / JERK_TIME_S))


def arms_of(links: FormationGraph, name: str) -> dict[str, float]:
    """Return the radii [m] of the circles on which a vehicle carries others round when it turns."""
    turning = {**links, name: ()}
    heads = {other: np.zeros(4) for other, own in turning.items() if not own}
    ahead = places(turning, heads)
    back = places(turning, {**heads, name: np.array([0.0, 0.0, 0.0, np.pi])})
    arms = {
        other: 0.5 * float(np.linalg.norm(ahead[other][:2] - back[other][:2]))
        for other in followers(turning, name)
        if other in ahead
    }
    return {other: arm_m for other, arm_m in arms.items() if arm_m > SHORTEST_ARM_M}
