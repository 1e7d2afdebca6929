"""Equation (1) in plain numpy: what the kernels are compared with."""

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import (
    MOTION_SIZE,
    U_PITCH,
    U_ROLL,
    U_THRUST,
    U_YAW,
    XD_BODY,
    YAW,
    YAW_RATE,
    YD_BODY,
    ZD_BODY,
    Array,
    X,
    Y,
    Z,
)


def motion_derivative(model: Model, motion: Array, actuator: Array, disturbance: Array) -> Array:
    """Time derivative of the motion state, shape (8,), by equation (1).

    Parameters
    ----------
    actuator
        Inputs after their lag, shape (4,).
    disturbance
        Accelerations: body x, body y, z [m/s^2], yaw [rad/s^2], shape (4,).
    """
    c, s = np.cos(motion[YAW]), np.sin(motion[YAW])
    xd, yd, zd, yaw_rate = motion[XD_BODY : YAW_RATE + 1]
    b, k = model.input_gain, model.direct_damping
    derivative = np.empty(MOTION_SIZE)
    derivative[X] = c * xd - s * yd
    derivative[Y] = s * xd + c * yd
    derivative[Z] = zd
    derivative[YAW] = yaw_rate
    derivative[XD_BODY] = b[U_PITCH] * actuator[U_PITCH] + k[U_PITCH] * xd + yaw_rate * yd + disturbance[0]
    derivative[YD_BODY] = b[U_ROLL] * actuator[U_ROLL] + k[U_ROLL] * yd - yaw_rate * xd + disturbance[1]
    derivative[ZD_BODY] = (
        b[U_THRUST] * actuator[U_THRUST] + k[U_THRUST] * zd - model.gravity_m_s2 + disturbance[2]
    )
    derivative[YAW_RATE] = b[U_YAW] * actuator[U_YAW] + k[U_YAW] * yaw_rate + disturbance[3]
    return derivative


def input_behind_gyro(model: Model, motion: Array, actuator: Array, applied_input: Array) -> Array:
    """Input that the actuators follow, shape (4,): the applied one, with gyro and thrust coupling on the yaw
    stick.

    `actuator` are the inputs after their lag, shape (4,).
    """
    if not (model.yaw_gyro or model.thrust_coupling):
        return applied_input
    followed = applied_input.copy()
    ahead = float(applied_input[U_THRUST] - actuator[U_THRUST])
    followed[U_YAW] += model.thrust_coupling * ahead - model.rate_feedback[U_YAW] * float(motion[YAW_RATE])
    return followed
