"""Consensus on the places of a formation, without a leader (Ren and Beard 2008, chapters 4 and 8).

Every vehicle has a virtual place. Places move as double integrators that are drawn to those of all neighbours
plus the wanted offsets, and the virtual place of a vehicle with a task of its own also to that. The graph may
have cycles. Errors of an eigenvalue lambda of the graph's Laplacian decay with the roots of
s^2 + lambda damping s + lambda stiffness.
"""

import numpy as np

from rcopterx.control.scheme import Situation
from rcopterx_studies.schemes.tracked import Gain, Moving, SchemePath, TrackedScheme, TrackedSettings


class ConsensusSettings(TrackedSettings, frozen=True, kw_only=True):
    """Settings of consensus."""

    stiffness_per_s2: Gain = 9.0
    """Acceleration of a virtual place towards another one, per distance."""
    damping_per_s: Gain = 6.0
    """The same, per difference of velocities."""
    task_weight: Gain = 3.0
    """How much more a vehicle is drawn to its own task than to a neighbour."""


class ConsensusScheme(TrackedScheme[ConsensusSettings]):
    """Second-order consensus; vehicles send their virtual places, which the cascade tracks."""

    Settings = ConsensusSettings
    Message = Moving

    def _exchange(self, situation: Situation) -> Moving:
        gains = np.array((self._settings.stiffness_per_s2, self._settings.damping_per_s))
        position, velocity = self._state()
        acceleration = self._drawn(situation, position, velocity, gains, self._settings.task_weight * gains)
        self._fly(SchemePath(position, velocity, acceleration[None], 2.0 * self.period_s))
        return Moving.of(position, velocity)
