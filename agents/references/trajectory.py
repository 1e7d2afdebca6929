"""A sampled trajectory: what a plan is, and what a reference is.

Everything is in the inertial frame and in SI units, so a trajectory means the same to every vehicle whatever
its heading, type or scaling; the rotations of the formation law (6) happen where a controller needs
body-frame quantities. Plans and references being the same thing is what makes following a mere subscription.
"""

from typing import Final

import numpy as np
from msgspec import Struct

from rcopterx.vehicles.state import Array

POSITION: Final = slice(0, 3)
YAW: Final = 3
VELOCITY: Final = slice(4, 7)
YAW_RATE: Final = 7
ACCELERATION: Final = slice(8, 11)
YAW_ACCELERATION: Final = 11
COLUMNS: Final = 12


class Trajectory(Struct, frozen=True):
    """Stages of a trajectory, `period_s` apart.

    Attributes
    ----------
    samples
        Shape (N, 12): position [m], yaw [rad], velocity [m/s], yaw rate [rad/s], acceleration [m/s^2], yaw
        acceleration [rad/s^2]; inertial frame, yaw unwrapped.
    period_s
        Time between stages.
    """

    samples: Array
    period_s: float

    @property
    def stages(self) -> int:
        """Number of stages N."""
        return len(self.samples)

    @property
    def position_m(self) -> Array:
        """Positions, shape (N, 3)."""
        return self.samples[:, POSITION]

    @property
    def yaw_rad(self) -> Array:
        """Headings, shape (N,)."""
        return self.samples[:, YAW]

    @property
    def velocity_m_s(self) -> Array:
        """Inertial velocities, shape (N, 3)."""
        return self.samples[:, VELOCITY]

    @property
    def yaw_rate_rad_s(self) -> Array:
        """Yaw rates, shape (N,)."""
        return self.samples[:, YAW_RATE]

    @property
    def acceleration_m_s2(self) -> Array:
        """Inertial accelerations, shape (N, 3)."""
        return self.samples[:, ACCELERATION]

    @property
    def yaw_acceleration_rad_s2(self) -> Array:
        """Yaw accelerations, shape (N,)."""
        return self.samples[:, YAW_ACCELERATION]

    def resampled(self, start_s: float, period_s: float, stages: int) -> "Trajectory":
        """Read the trajectory at other instants.

        Between stages values are interpolated linearly (exact on the stages themselves). Before the first
        stage the vehicle is taken to have come with the first velocity, and beyond the last one to go on with
        the last; unaccelerated, except within a period of the first stage: a follower whose delay is a little
        shorter than its leader's begins there.

        Parameters
        ----------
        start_s
            Time of the first new stage, counted from the first stage of this trajectory.
        period_s
            Time between the new stages.
        stages
            Number of new stages.

        Returns
        -------
        Trajectory
            The new stages, in an array of their own.
        """
        shift = start_s / self.period_s
        first = round(shift)
        if period_s == self.period_s and abs(shift - first) < 1e-6 and 0 <= first < self.stages:
            return Trajectory(self._from_stage(first, stages), period_s)
        at = (start_s + period_s * np.arange(stages)) / self.period_s
        nearest = np.round(at)
        at = np.where(np.abs(at - nearest) < 1e-6, nearest, at)
        last = self.stages - 1
        inside = np.clip(at, 0, last)
        lower = np.minimum(inside.astype(np.intp), max(last - 1, 0))
        fraction = (inside - lower)[:, None]
        upper = np.minimum(lower + 1, last)
        samples = self.samples[lower] * (1 - fraction) + self.samples[upper] * fraction
        beyond_s = np.maximum(at - last, 0.0) * self.period_s
        if beyond_s[-1] > 0:
            samples[:, :4] += beyond_s[:, None] * self.samples[-1, 4:8]
            samples[beyond_s > 0, 8:] = 0.0
        before_s = np.minimum(at, 0.0) * self.period_s
        if before_s[0] < 0:
            samples[:, :4] += before_s[:, None] * self.samples[0, 4:8]
            samples[at <= -1, 8:] = 0.0
        return Trajectory(samples, period_s)

    def _from_stage(self, first: int, stages: int) -> Array:
        """Samples from a stage on, shape (`stages`, 12)."""
        samples = np.empty((stages, COLUMNS))
        inside = self.samples[first : first + stages]
        samples[: len(inside)] = inside
        beyond, last = samples[len(inside) :], self.samples[-1]
        if len(beyond):
            ahead_s = self.period_s * np.arange(1, len(beyond) + 1)[:, None]
            beyond[:, :4] = last[:4] + ahead_s * last[4:8]
            beyond[:, 4:8], beyond[:, 8:] = last[4:8], 0.0
        return samples

    def positions_from(self, start_s: float, period_s: float, stages: int) -> Array:
        """Positions at other instants, as of `resampled` but without the rest; shape (`stages`, 3)."""
        shift = start_s / self.period_s
        first = round(shift)
        if first < 0 or first >= self.stages or abs(shift - first) > 1e-6 or period_s != self.period_s:
            return self.resampled(start_s, period_s, stages).position_m
        inside = self.samples[first : first + stages, POSITION]
        missing = stages - len(inside)
        if not missing:
            return inside
        ahead_s = period_s * np.arange(1, missing + 1)[:, None]
        last = self.samples[-1]
        positions_m = np.empty((stages, 3))
        positions_m[:-missing] = inside
        positions_m[-missing:] = last[POSITION] + ahead_s * last[VELOCITY]
        return positions_m


def hold(position_m: Array, yaw_rad: float, period_s: float, stages: int) -> Trajectory:
    """Trajectory of a set point: rest at one place.

    Parameters
    ----------
    position_m
        Set point in the inertial frame, shape (3,).
    yaw_rad
        Heading, unwrapped.
    period_s
        Time between stages.
    stages
        Number of stages.

    Returns
    -------
    Trajectory
        The set point at every stage.
    """
    samples = np.zeros((stages, COLUMNS))
    samples[:, POSITION] = position_m
    samples[:, YAW] = yaw_rad
    return Trajectory(samples, period_s)
