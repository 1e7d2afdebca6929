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

_NO_OFFSET_M: Final[Array] = np.zeros(3)


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
        return self.displaced(start_s, period_s, stages, _NO_OFFSET_M, 0.0)

    def displaced(
        self, start_s: float, period_s: float, stages: int, offset_m: Array, yaw_offset_rad: float
    ) -> "Trajectory":
        """As `resampled`, with an offset of the positions, shape (3,), and one of the headings."""
        # Scripts and the web page use paths, which are trajectories, but need no kernels.
        from rcopterx.control.references.sampling import resample

        samples = np.empty((stages, COLUMNS))
        resample(self.samples, self.period_s, start_s, period_s, offset_m, yaw_offset_rad, samples)
        return Trajectory(samples, period_s)

    def positions_from(self, start_s: float, period_s: float, stages: int) -> Array:
        """Positions at other instants, as of `resampled`; shape (`stages`, 3)."""
        return self.displaced(start_s, period_s, stages, _NO_OFFSET_M, 0.0).samples[:, POSITION]


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
