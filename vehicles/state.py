"""Arrays and tuples; index names of the motion state and the input (equation (1) of the paper).

The motion state is x, y, z in the inertial frame [m], the yaw psi [rad, unwrapped], the body-frame velocity
[m/s] and the yaw rate [rad/s]. Body x points to the nose, body z along the rotor axis. The input is
normalised stick deflection: pitch, roll, thrust, yaw.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rcopterx.vehicles.tuples import Four, Three

Array = NDArray[np.float64]
"""An array of 64-bit floats; its shape is stated where it is used."""


def three(values: Array) -> Three:
    """Array of shape (3,) as a tuple."""
    x, y, z = values.tolist()
    return (x, y, z)


def four(values: Array) -> Four:
    """Array of shape (4,) as a tuple."""
    a, b, c, d = values.tolist()
    return (a, b, c, d)


GRAVITY_M_S2: Final = 9.81

X: Final = 0
Y: Final = 1
Z: Final = 2
YAW: Final = 3
XD_BODY: Final = 4
YD_BODY: Final = 5
ZD_BODY: Final = 6
YAW_RATE: Final = 7
MOTION_SIZE: Final = 8

U_PITCH: Final = 0
U_ROLL: Final = 1
U_THRUST: Final = 2
U_YAW: Final = 3
INPUT_SIZE: Final = 4


def heading_matrix(yaw_rad: float) -> Array:
    """Rotation R(psi), shape (2, 2), from the body (heading) frame to the inertial frame."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array(((c, -s), (s, c)))


def inertial_velocity(motion: Array) -> Array:
    """Return the velocity of a motion state in the inertial frame, shape (3,)."""
    return turned_about_z(motion[XD_BODY:YAW_RATE], float(motion[YAW]))


def body_motion(pose: Array, rates: Array) -> Array:
    """Return the motion state of a pose with inertial velocity and yaw rate, both of shape (4,)."""
    return np.concatenate((pose, turned_about_z(rates, -float(pose[YAW]))))


def inertial_rates(motion: Array) -> Array:
    """Inertial velocity and yaw rate of a motion state, shape (4,)."""
    return turned_about_z(motion[XD_BODY : YAW_RATE + 1], float(motion[YAW]))


def turned_about_z(vector: Array, yaw_rad: float) -> Array:
    """Return a vector whose first two components are turned by R(psi), the others kept."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    x, y = vector[:2].tolist()
    result = vector.copy()
    result[0], result[1] = c * x - s * y, s * x + c * y
    return result
