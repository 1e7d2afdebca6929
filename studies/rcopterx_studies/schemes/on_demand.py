"""Distributed MPC with on-demand collision avoidance (Luis, Vukosavljev, Schoellig 2020).

All vehicles plan at the same times, several times per second, with the last announced paths of the others. A
path is constrained only if the last one collides: from the stage before the first collision on, by planes
beside the vehicles that are near, as soft constraints. (The paper constrains one stage, which is as long as a
round.) It begins where the last one is, unless the vehicle is too far from that; then it begins at the
vehicle (event-triggered replanning).
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from rcopterx.control.scheme import Situation
from rcopterx.vehicles.state import Array, inertial_velocity
from rcopterx_studies.schemes.planner import Plane
from rcopterx_studies.schemes.replanning import Announced, ReplanningScheme, ReplanningSettings

NEAR: Final = 1.5  # distance in ellipsoids up to which vehicles get a plane at a stage


class OnDemandSettings(ReplanningSettings, frozen=True, kw_only=True):
    """Settings of the scheme."""

    deviation_m: float = 0.3
    """Distance from its path at which a vehicle plans from where it is."""


class OnDemandScheme(ReplanningScheme[OnDemandSettings]):
    """Plans with constraints on demand; the cascade tracks the path."""

    Settings = OnDemandSettings

    def _plan_round(self, situation: Situation) -> Announced:
        now_s, motion = situation.time_s, situation.estimate.motion
        times_s = now_s + self._stage_times_s
        others, own = self._others(situation, times_s), self._own(times_s)
        position, velocity = self._state()
        if np.linalg.norm(motion[:3] - position) > self._settings.deviation_m:
            position = motion[:3].copy()
            velocity = inertial_velocity(motion)
        targets = self._targets(situation, others, now_s)
        self._fly(self._plan(position, velocity, targets, self._planes(own, others)))
        return self._announce()

    def _planes(self, own: Array, others: Mapping[str, Array]) -> list[Plane]:
        """Planes from the first collision of the last path on."""
        distances = self._distances(own, others)
        colliding = [int(np.argmax(each < 1.0)) for each in distances.values() if (each < 1.0).any()]
        if not colliding:
            return []
        return [
            self._plane(stage, own, others[name], halved=False)
            for stage in range(max(min(colliding) - 1, 1), len(own) - 1)
            for name, each in distances.items()
            if each[stage] < NEAR
        ]
