"""Schemes that plan positions, which the cascade below them tracks.

A path is what a point mass flies with accelerations that are constant in each of its stages.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Annotated, Final, Generic, NamedTuple, TypeVar

import numpy as np
from msgspec import Meta, Struct

from rcopterx.control.controllers.cascade.controller import CascadeController, CascadeSettings
from rcopterx.control.controllers.settings import Horizon
from rcopterx.control.interfaces import ControlStep, Estimate, never
from rcopterx.control.references.columns import ACCELERATION, POSITION, VELOCITY
from rcopterx.control.references.trajectory import Trajectory
from rcopterx.control.scheme import Situation
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array, inertial_velocity, three
from rcopterx.vehicles.tuples import Three
from rcopterx_studies.schemes.messages import Samples, linked

INSTANT_S: Final = 1e-6  # tolerance of times that are multiples of a stage or a round
Gain = Annotated[float, Meta(gt=0.0, le=1e6)]
ACCELERATION_SHARE: Final = 0.8
"""Share of the acceleration that the weakest vehicle of a type surely has, for plans."""
BRAKING_STAGES: Final = 6
BRAKING_STAGE_S: Final = 0.1
SPEED_SHARE: Final = 0.8  # share of the velocity bounds, for plans


class SchemePath(NamedTuple):
    """A path from a position and a velocity, shape (3,), with accelerations of stages, shape (K, 3)."""

    position_m: Array
    velocity_m_s: Array
    acceleration_m_s2: Array
    stage_s: float

    @classmethod
    def unpacked(cls, samples: Samples, stage_s: float) -> "SchemePath":
        """Unpack a path from a message."""
        rows = samples.to_numpy()
        return cls(rows[0], rows[1], rows[2:], stage_s)

    def braked(self, velocity_m_s: Array) -> "SchemePath":
        """Return the path with stages in which the velocity at its end, shape (3,), falls to zero."""
        braking = np.tile(-velocity_m_s / (BRAKING_STAGES * self.stage_s), (BRAKING_STAGES, 1))
        return self._replace(acceleration_m_s2=np.vstack((self.acceleration_m_s2, braking)))

    def packed(self) -> Samples:
        """Pack for a message: position, velocity, accelerations."""
        return Samples.of(np.vstack((self.position_m, self.velocity_m_s, self.acceleration_m_s2)))

    def at(self, times_s: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities, accelerations at some times, shape (n, 3); at the end the velocity stays."""
        h, a = self.stage_s, np.vstack((self.acceleration_m_s2, np.zeros(3)))
        v = self.velocity_m_s + h * np.vstack((np.zeros(3), np.cumsum(a[:-1], axis=0)))
        p = self.position_m + np.vstack((np.zeros(3), np.cumsum(h * v[:-1] + h**2 / 2 * a[:-1], axis=0)))
        k = np.clip((times_s / h + 1e-9).astype(int), 0, len(a) - 1)
        t = (times_s - h * k)[:, None]
        return p[k] + t * v[k] + t**2 / 2 * a[k], v[k] + t * a[k], a[k]


class Moving(Struct, frozen=True):
    """Message: a place and its velocity, inertial frame."""

    position_m: Three
    velocity_m_s: Three

    @classmethod
    def of(cls, position_m: Array, velocity_m_s: Array) -> "Moving":
        """Pack arrays of shape (3,)."""
        return cls(three(position_m), three(velocity_m_s))

    def after(self, age_s: float) -> tuple[Array, Array]:
        """Return position and velocity after a time at constant velocity, shape (3,) each."""
        velocity = np.array(self.velocity_m_s)
        return np.array(self.position_m) + age_s * velocity, velocity


class TrackedSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of all schemes with a tracking controller."""

    horizon: Horizon = 50
    """Number of stages of the tracking controller."""


S = TypeVar("S", bound=TrackedSettings)


class TrackedScheme(ABC, Generic[S]):
    """A scheme around a path: `exchange` chooses it, `step` tracks it."""

    exchanges = 1

    def __init__(self, model: Model, period_s: float, settings: S) -> None:
        self.horizon, self.period_s, self._settings = settings.horizon, period_s, settings
        self._tracker = CascadeController(model, period_s, CascadeSettings(horizon=settings.horizon))
        self._reach: Array = ACCELERATION_SHARE * model.sure_reach[[0, 0, 1]]
        """Largest planned accelerations, shape (3,)."""
        self._speed: Array = SPEED_SHARE * np.array(model.state_max)[3:6]
        """Largest planned speeds, shape (3,)."""
        self._path: SchemePath | None = None
        self._began_s = self._time_s = 0.0  # when the path began, and the time of the last exchange
        self._ages_s: Array = period_s * np.arange(float(settings.horizon))

    def reset(self, estimate: Estimate, last_input: Array) -> None:
        """Start from a flying vehicle."""
        self._path = None
        self._tracker.reset(estimate, last_input)

    def exchange(self, situation: Situation) -> Struct | None:
        """See `Scheme.exchange`."""
        self._time_s = situation.time_s
        if self._path is None:
            motion = situation.estimate.motion
            velocity = inertial_velocity(motion)
            self._fly(
                SchemePath(motion[:3].copy(), velocity, np.zeros((0, 3)), BRAKING_STAGE_S).braked(velocity)
            )
        return self._exchange(situation)

    def step(
        self,
        estimate: Estimate,
        reference: Trajectory,
        last_input: Array,
        expired: Callable[[], bool] = never,
    ) -> ControlStep:
        """Track the path; headings are those of the reference."""
        samples = reference.samples.copy()
        if self._path is not None:
            at = self._path.at(self._time_s - self._began_s + self._ages_s)
            samples[:, POSITION], samples[:, VELOCITY], samples[:, ACCELERATION] = at
        return self._tracker.step(estimate, Trajectory(samples, reference.period_s), last_input, expired)

    @abstractmethod
    def _exchange(self, situation: Situation) -> Struct | None:
        """Choose the path and return the message."""

    def _drawn(
        self, situation: Situation, position: Array, velocity: Array, relative_gain: Array, own_gain: Array
    ) -> Array:
        """Acceleration towards the neighbours' places plus offsets, and towards a task of its own.

        Gains are those of differences of position and velocity, shape (2,).
        """
        state, acceleration = np.stack((position, velocity)), np.zeros(3)
        for _, other, age_s, offset_m, _ in linked(situation, Moving):
            place, other_velocity = other.after(age_s)
            acceleration -= relative_gain @ (state - np.stack((place + offset_m, other_velocity)))
        if not situation.follows:
            reference = situation.reference
            task = np.stack((reference.position_m[0], reference.velocity_m_s[0]))
            acceleration -= own_gain @ (state - task)
        return np.asarray(np.clip(acceleration, -self._reach, self._reach))

    def _fly(self, path: SchemePath, from_s: float | None = None) -> None:
        """Fly a path that begins now, or at another time."""
        self._path, self._began_s = path, self._time_s if from_s is None else from_s

    def _state(self, time_s: float | None = None) -> tuple[Array, Array]:
        """Position and velocity of the path now or at another time, shape (3,)."""
        assert self._path is not None
        time_s = self._time_s if time_s is None else time_s
        position, velocity, _ = self._path.at(np.array([time_s - self._began_s]))
        return position[0], velocity[0]
