"""Poses of motion capture for the estimator of an autopilot, by MAVLink 2 (mavlink.io, common)."""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rcopterx.vehicles.tuples import Three


def vision_pose(
    time_s: float, position_m: Three, angles_rad: Three
) -> mavlink.MAVLink_vision_position_estimate_message:
    """Return the message of a pose with unknown covariance.

    `position_m`: z up. `angles_rad`: roll, pitch nose up, and yaw clockwise from above.
    """
    x, y, z = position_m
    return mavlink.MAVLink_vision_position_estimate_message(
        round(1e6 * time_s), x, -y, -z, *angles_rad, [math.nan] * 21
    )
