"""Distributed LQR for equal vehicles with decoupled dynamics (Borrelli and Keviczky 2008).

With the costs Q of own errors and Q_r of the errors between two vehicles, n vehicles that all know each other
are controlled best by a_i = -K x_i - K_r sum_j (x_i - x_j), with the gains

    K = lqr(Q),    K_r = (lqr(Q + n Q_r) - lqr(Q)) / n

of problems of one vehicle. The scheme uses them on any graph in which a vehicle has less than n neighbours.
Vehicles that follow have no own errors. States are position and velocity, as estimated; the cascade flies the
accelerations.
"""

from typing import Annotated

import numpy as np
from msgspec import Meta

from rcopterx.control.models.linear import regulator
from rcopterx.control.scheme import Situation
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array, inertial_velocity
from rcopterx_studies.schemes.tracked import Gain, Moving, SchemePath, TrackedScheme, TrackedSettings


class DistributedLqrSettings(TrackedSettings, frozen=True, kw_only=True):
    """Settings of the scheme; weights of positions, of velocities, and of accelerations."""

    task_weights: tuple[Gain, Gain] = (36.0, 6.0)
    relative_weights: tuple[Gain, Gain] = (200.0, 40.0)
    effort_weight: Gain = 1.0
    vehicles: Annotated[int, Meta(ge=2, le=64)] = 4
    """Number n of vehicles that know each other."""
    acting_s: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.1
    """Time for which an acceleration is planned."""


class DistributedLqrScheme(TrackedScheme[DistributedLqrSettings]):
    """LQR of own and relative errors; vehicles send their estimated states."""

    Settings = DistributedLqrSettings
    Message = Moving

    def __init__(self, model: Model, period_s: float, settings: DistributedLqrSettings) -> None:
        super().__init__(model, period_s, settings)
        Q, Q_relative = np.diag(settings.task_weights), np.diag(settings.relative_weights)
        R = np.array([[settings.effort_weight]])
        A, B = np.array([[1.0, period_s], [0.0, 1.0]]), np.array([[period_s**2 / 2], [period_s]])
        self._own_gain, self._relative_gain = distributed_gains(A, B, Q, Q_relative, R, settings.vehicles)

    def _exchange(self, situation: Situation) -> Moving:
        position, velocity = situation.estimate.motion[:3], inertial_velocity(situation.estimate.motion)
        gains = self._relative_gain[0], self._own_gain[0]
        acceleration = self._drawn(situation, position, velocity, *gains)
        self._fly(SchemePath(position.copy(), velocity, acceleration[None], self._settings.acting_s))
        return Moving.of(position, velocity)


def distributed_gains(
    A: Array, B: Array, Q: Array, Q_relative: Array, R: Array, vehicles: int
) -> tuple[Array, Array]:
    """Return the gains K and K_r of equal vehicles that all know each other."""
    own = regulator(A, B, Q, R)
    return own, (regulator(A, B, Q + vehicles * Q_relative, R) - own) / vehicles
