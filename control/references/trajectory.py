"""A sampled trajectory, the common type of plans and references.

It is in the inertial frame and in SI units, so that it means the same to every vehicle; the rotations of the
formation law (6) happen where a controller needs body-frame quantities.
"""

import math
from typing import Final

import numpy as np
from msgspec import Struct

from rcopterx.control.references import columns
from rcopterx.vehicles.state import Array

_NO_OFFSET_M: Final[Array] = np.zeros(3)


class Trajectory(Struct, frozen=True):
    """Stages of a trajectory, `period_s` apart.

    `samples` has shape (N, 12): position [m], yaw [rad], velocity [m/s], yaw rate [rad/s], acceleration
    [m/s^2], yaw acceleration [rad/s^2]; inertial frame, yaw unwrapped.
    """

    samples: Array
    period_s: float

    @property
    def position_m(self) -> Array:
        """Positions, shape (N, 3)."""
        return self.samples[:, columns.POSITION]

    @property
    def yaw_rad(self) -> Array:
        """Headings, shape (N,)."""
        return self.samples[:, columns.YAW]

    @property
    def velocity_m_s(self) -> Array:
        """Inertial velocities, shape (N, 3)."""
        return self.samples[:, columns.VELOCITY]

    @property
    def yaw_rate_rad_s(self) -> Array:
        """Yaw rates, shape (N,)."""
        return self.samples[:, columns.YAW_RATE]

    @property
    def yaw_acceleration_rad_s2(self) -> Array:
        """Yaw accelerations, shape (N,)."""
        return self.samples[:, columns.YAW_ACCELERATION]

    def resampled(self, start_s: float, period_s: float, stages: int) -> "Trajectory":
        """Return `stages` stages from `start_s` on, counted from the first stage of this trajectory.

        Between stages values are interpolated linearly. Outside, the vehicle moves with the velocity of
        the nearest end, without acceleration except within a period before the first stage: a follower
        with a slightly shorter delay than its leader's begins there.
        """
        return self.displaced(start_s, period_s, stages, _NO_OFFSET_M, 0.0)

    def displaced(
        self, start_s: float, period_s: float, stages: int, offset_m: Array, yaw_offset_rad: float
    ) -> "Trajectory":
        """As `resampled`, with an offset of the positions, shape (3,), and one of the headings."""
        # Scripts and the web page use paths, which are trajectories, but need no kernels.
        from rcopterx.control.references.sampling import resample

        samples = np.empty((stages, columns.COLUMNS))
        resample(self.samples, self.period_s, start_s, period_s, offset_m, yaw_offset_rad, samples)
        return Trajectory(samples, period_s)


def hold(position_m: Array, yaw_rad: float, period_s: float, stages: int) -> Trajectory:
    """Return the trajectory of a set point: rest at one place, shape (3,)."""
    samples = np.zeros((stages, columns.COLUMNS))
    samples[:, columns.POSE] = *position_m, yaw_rad
    return Trajectory(samples, period_s)


def whole_turns(difference_rad: float) -> int:
    """Return the number of whole turns in a difference of headings, so that at most half a turn remains."""
    return round(difference_rad / math.tau)


def nearest_heading(yaw_rad: float, near_rad: float) -> float:
    """Return the same heading with the turns that bring it closest to another one."""
    return yaw_rad + math.tau * whole_turns(near_rad - yaw_rad)


def on_turn_of(reference: Trajectory, yaw_rad: float) -> Trajectory:
    """Return the trajectory with the turns that bring its first heading closest to another one."""
    turns = whole_turns(yaw_rad - float(reference.yaw_rad[0]))
    if turns == 0:
        return reference
    turned = Trajectory(reference.samples.copy(), reference.period_s)
    turned.yaw_rad[:] += math.tau * turns
    return turned
