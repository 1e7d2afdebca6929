"""Leaders plan within what their followers can do, whoever these are at the moment.

A leader that flies at its own limits cannot be followed by an equal vehicle in a gust, and not at all by one
that accelerates less. And what its pitch and roll do together, a follower with another heading may need of
one stick alone: sticks are limited one by one, so that 0.65 of both are 0.92 of one. So a leader plans with
0.65 of what the weakest of its followers can do, with four fifths of what that one may plan with if others
follow it, and no faster than the slowest of them. A leader's heading turns with 0.92 of the yaw rate that its
followers may have: one that has fallen behind could not catch up, and would fly along its bound.
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
"""Shares of what a follower can do that a turn of its leader may ask of it; the rest is for all else."""
SHORTEST_ARM_M = 0.02

_RATES_OF_LEADERS = np.array([1.0, 1.0, 1.0, YAW_RATE_SHARE])


def limit_scale_of(links: FormationGraph, models: Mapping[str, Model], name: str) -> LimitScale:
    """Scale of its own limits a vehicle may plan with.

    Parameters
    ----------
    links
        Who follows whom.
    models
        Vehicles by name; one that is missing is taken for an equal of its leader.
    name
        The vehicle.
    """
    return _scale(links, models, name, len(links))


def _scale(links: FormationGraph, models: Mapping[str, Model], name: str, levels: int) -> LimitScale:
    """Scale by the followers of so many levels; there are no more of them, except in a cycle."""
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
    """How fast a vehicle may turn, for those it carries round; None where there are none.

    Followers whose offsets turn with the heading fly an arc as their leader turns; those at the end of long
    arms soon cannot.

    Parameters
    ----------
    links
        Who follows whom.
    models
        Vehicles by name; one that is missing is taken for an equal of its leader.
    name
        The vehicle.
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
    """Radii of the circles on which a vehicle carries others round when it turns [m]."""
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
    """What the inputs can do in either direction from hovering, in the order of the inputs."""
    reach = model.b * np.minimum(model.u_max - model.hover_input, model.hover_input - model.u_min)
    return _at_any_heading(reach)


def _speeds(model: Model) -> Array:
    """Half the ranges of body velocities and yaw rate."""
    return _at_any_heading(0.5 * np.subtract(model.state_max, model.state_min)[3:])


def _at_any_heading(reach: Array) -> Array:
    """Pitch and roll alike, because a follower's heading is another one than its leader's."""
    horizontal = float(reach[:2].min())
    return np.array([horizontal, horizontal, *reach[2:]])


class LimitScaling:
    """Keeps a controller's limits in step with the vehicles that follow.

    Parameters
    ----------
    vehicle
        Own name.
    models
        All vehicles of the fleet by name.
    """

    def __init__(self, vehicle: str, models: Mapping[str, Model]) -> None:
        self._vehicle = vehicle
        self._models = models
        self._told: tuple[Controller, LimitScale] | None = None
        self._leaders: dict[str, tuple[str, ...]] = {}
        """Of every vehicle, when the controller was told last."""

    def update(self, controller: Controller, settings: Mapping[str, object], links: FormationGraph) -> None:
        """Tell the controller its scale if that, or the controller, is another one than before.

        Parameters
        ----------
        controller
            Present controller.
        settings
            Its settings; a fixed `input_range` among them is left alone.
        links
            Who follows whom; where nobody is heard of, nothing is known and nothing changes.
        """
        if "input_range" in settings or not links.keys() - {self._vehicle}:
            return
        leaders = {name: leaders_of(links, name) for name in links}
        told = self._told
        if (told is not None and told[0] is controller and leaders == self._leaders) or not isinstance(
            controller, ScalesLimits
        ):
            return
        scale = limit_scale_of(links, self._models, self._vehicle)
        if told is None or told[0] is not controller or told[1] != scale:
            controller.set_limit_scale(scale)
            self._told = (controller, scale)
        self._leaders = leaders
