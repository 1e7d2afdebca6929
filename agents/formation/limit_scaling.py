"""Limits of leaders, which plan within the abilities of their present followers.

A leader that flies at its own limits cannot be followed by an equal vehicle in a gust, and not at all by one
that accelerates less. A follower with another heading may need of one stick alone what the leader's pitch and
roll do together: sticks are limited one by one, so that 0.65 of both are 0.92 of one. So a leader plans with
0.65 of the ability of the weakest of its followers, with four fifths of the limits of a follower that leads
others, and no faster than the slowest of them. Its heading turns with 0.92 of the yaw rate of its followers:
one that has fallen behind could not catch up otherwise.
"""

from collections.abc import Mapping

import numpy as np

from rcopterx.agents.formation.topology import FormationGraph, followers, leaders_of, places
from rcopterx.control.interfaces import Controller, LimitScale, ScalesLimits
from rcopterx.control.references.set_points import TurnLimits
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

LEADER_LIMIT_SCALE = 0.65
"""Share of its followers' accelerations a leader plans with."""
NEXT_LIMIT_SCALE = 0.8
"""Share of what a follower plans with, as it leads others itself, that its own leader plans with."""
YAW_RATE_SHARE = 0.92
"""Share of the yaw rate that its followers may have that a leader plans with."""
ARM_SPEED_SHARE = 0.8
ARM_ACCELERATION_SHARE = 0.5
"""Shares of a follower's limits that a turn of its leader may use."""
SHORTEST_ARM_M = 0.02

_RATES_OF_LEADERS = np.array([1.0, 1.0, 1.0, YAW_RATE_SHARE])


def limit_scale_of(links: FormationGraph, models: Mapping[str, Model], name: str) -> LimitScale:
    """Return the share of its own limits that a vehicle plans with.

    Vehicles without a model count as equal to their leader.
    """
    return _scale(links, models, name, len(links))


def _scale(links: FormationGraph, models: Mapping[str, Model], name: str, levels: int) -> LimitScale:
    """Return the scale by the followers of `levels` levels, which bounds the recursion in a cycle."""
    inputs, rates = np.ones(4), np.ones(4)
    followers = [other for other in links if name in leaders_of(links, other)] if levels else []
    for other in followers:
        below = _scale(links, models, other, levels - 1)
        weaker, slower = _compared(models.get(other), models.get(name))
        planned = np.minimum(LEADER_LIMIT_SCALE, NEXT_LIMIT_SCALE * np.array(below.inputs))
        inputs = np.minimum(inputs, weaker * planned)
        rates = np.minimum(rates, slower * np.array(below.rates) * _RATES_OF_LEADERS)
    return LimitScale(tuple(inputs.tolist()), tuple(rates.tolist()))


def turn_limits_of(links: FormationGraph, models: Mapping[str, Model], name: str) -> TurnLimits | None:
    """Return the turn limits of a vehicle for the followers it carries round; None if it carries none.

    Followers whose offsets turn with the heading fly an arc as their leader turns, faster at longer arms.
    Vehicles without a model count as equal to this one.
    """
    rate, acceleration = np.inf, np.inf
    for follower, arm_m in arms_of(links, name).items():
        model = models.get(follower, models.get(name))
        if model is None:
            continue
        speeds = _speeds(model)
        rate = min(rate, ARM_SPEED_SHARE * float(speeds[0]) / arm_m, YAW_RATE_SHARE * float(speeds[3]))
        acceleration = min(acceleration, ARM_ACCELERATION_SHARE * float(_accelerations(model)[0]) / arm_m)
    return TurnLimits(rate, acceleration) if np.isfinite(rate) else None


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


def _compared(follower: Model | None, leader: Model | None) -> tuple[Array, Array]:
    """Accelerations and speeds of a follower over those of its leader."""
    if follower is None or leader is None:
        return np.ones(4), np.ones(4)
    return _accelerations(follower) / _accelerations(leader), _speeds(follower) / _speeds(leader)


def _accelerations(model: Model) -> Array:
    """Accelerations by the inputs in either direction from hovering, in the order of the inputs."""
    reach = model.b * np.minimum(model.u_max - model.hover_input, model.hover_input - model.u_min)
    return _at_any_heading(reach)


def _speeds(model: Model) -> Array:
    """Half the ranges of body velocities and yaw rate."""
    return _at_any_heading(0.5 * np.subtract(model.state_max, model.state_min)[3:])


def _at_any_heading(reach: Array) -> Array:
    """Return equal values for pitch and roll, because follower and leader may differ in heading."""
    horizontal = float(reach[:2].min())
    return np.array([horizontal, horizontal, *reach[2:]])


class LimitScaling:
    """Keeps a controller's limits in step with the vehicles that follow."""

    def __init__(self, vehicle: str, models: Mapping[str, Model]) -> None:
        self._vehicle = vehicle
        self._models = models
        self._last: tuple[Controller, LimitScale] | None = None

    def update(self, controller: Controller, settings: Mapping[str, object], links: FormationGraph) -> None:
        """Set the limits of the present controller, if they or the controller have changed.

        A fixed `input_range` in its settings has priority, and nothing changes while no other vehicle is
        known.
        """
        if "input_range" in settings or not links.keys() - {self._vehicle}:
            return
        if not isinstance(controller, ScalesLimits):
            return
        scale = limit_scale_of(links, self._models, self._vehicle)
        if self._last is None or self._last[0] is not controller or self._last[1] != scale:
            controller.set_limit_scale(scale)
            self._last = (controller, scale)
