"""What a vehicle that follows nobody is asked to fly: set points and smooth moves between them.

A reference source is sampled over the whole horizon at every step: the controller sees what is coming.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from agents.paths import FlightPath
from agents.trajectory import ACCELERATION, COLUMNS, POSITION, VELOCITY, YAW, Trajectory, hold
from vehicles.state import Array

PEAK_TO_MEAN_SPEED = 1.875
"""Ratio of the peak to the mean speed of a quintic that starts and ends at rest."""


class ReferenceSource(Protocol):
    """A reference as a function of time."""

    def sample(self, time_s: float, period_s: float, stages: int) -> Trajectory:
        """Reference at `stages` instants from `time_s` on, `period_s` apart."""
        ...

    def finished(self, time_s: float) -> bool:
        """Whether nothing changes any more from `time_s` on."""
        ...


@dataclass(frozen=True)
class SetPointReference:
    """Be at one place with one heading: position [m], shape (3,), and yaw [rad, unwrapped]."""

    position_m: Array
    yaw_rad: float

    def sample(self, time_s: float, period_s: float, stages: int) -> Trajectory:  # noqa: ARG002 - constant in time
        """See `ReferenceSource.sample`."""
        return hold(self.position_m, self.yaw_rad, period_s, stages)

    def finished(self, time_s: float) -> bool:  # noqa: ARG002 - constant in time
        """See `ReferenceSource.finished`."""
        return True


@dataclass(frozen=True)
class SmoothMove:
    """Quintic polynomial from rest to rest along a straight line, heading held.

    Attributes
    ----------
    start_m, end_m
        Positions, shape (3,).
    yaw_rad
        Heading.
    start_s, duration_s
        When it begins and how long it takes.
    """

    start_m: Array
    end_m: Array
    yaw_rad: float
    start_s: float
    duration_s: float

    @classmethod
    def at_speed(
        cls, start_m: Array, end_m: Array, yaw_rad: float, start_s: float, peak_speed_m_s: float
    ) -> "SmoothMove":
        """Move whose fastest moment has the given speed."""
        distance_m = float(np.linalg.norm(end_m - start_m))
        duration_s = max(PEAK_TO_MEAN_SPEED * distance_m / peak_speed_m_s, 1e-3)
        return cls(start_m, end_m, yaw_rad, start_s, duration_s)

    def sample(self, time_s: float, period_s: float, stages: int) -> Trajectory:
        """See `ReferenceSource.sample`."""
        at = (time_s - self.start_s + period_s * np.arange(stages)) / self.duration_s
        s = np.clip(at, 0.0, 1.0)[:, None]
        span = self.end_m - self.start_m
        samples = np.zeros((stages, COLUMNS))
        samples[:, YAW] = self.yaw_rad
        samples[:, POSITION] = self.start_m + span * s**3 * (10 + s * (6 * s - 15))
        samples[:, VELOCITY] = span * 30 * s**2 * (1 - s) ** 2 / self.duration_s
        samples[:, ACCELERATION] = span * 60 * s * (1 - s) * (1 - 2 * s) / self.duration_s**2
        return Trajectory(samples, period_s)

    def finished(self, time_s: float) -> bool:
        """See `ReferenceSource.finished`."""
        return time_s >= self.start_s + self.duration_s


@dataclass(frozen=True)
class PathReference:
    """A path that begins at a time; afterwards its end is held.

    Attributes
    ----------
    path
        The path.
    start_s
        When it begins.
    """

    path: FlightPath
    start_s: float

    def sample(self, time_s: float, period_s: float, stages: int) -> Trajectory:
        """See `ReferenceSource.sample`."""
        at_s: Array = time_s - self.start_s + period_s * np.arange(float(stages))
        return Trajectory(self.path.sample(at_s), period_s)

    def finished(self, time_s: float) -> bool:
        """See `ReferenceSource.finished`."""
        return time_s >= self.start_s + self.path.duration_s
