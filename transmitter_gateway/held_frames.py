"""Thrust of commands, as low as a vehicle survives if its radio repeats it.

On a starved computer a frame may be the last one for half a second, and receivers repeat it. A controller
that brakes a climb commands little thrust for some periods; repeated, it would end on the floor.
"""

import math

from rcopterx.vehicles.state import GRAVITY_M_S2

HELD_S = 0.5
"""Time for which a frame may be repeated."""
BRAKING_M_S2 = 4.0
"""Deceleration of the fall afterwards, its delay included."""
TOUCHDOWN_M_S = 0.8
"""Speed at which a vehicle may touch the floor instead."""


def least_thrust_share(height_m: float, climb_m_s: float) -> float:
    """Smallest thrust over that of a hover that leaves the vehicle safe if it is repeated for `HELD_S`.

    Afterwards the vehicle can brake above the floor, or it has reached the floor slowly.

    Parameters
    ----------
    height_m
        Height above the floor [m], positive.
    climb_m_s
        Climb rate [m/s], negative while it sinks.

    Returns
    -------
    float
        From 0 to 1.
    """
    # After T with the acceleration -a, the vehicle falls with s = a T - v at the height h + v T - a T^2 / 2.
    # If it needs all of this height to brake, s^2 / (2 b), then s^2 + b T s - 2 b (h + v T / 2) = 0.
    room = 2.0 * BRAKING_M_S2 * (height_m + climb_m_s * HELD_S / 2.0)
    linear = BRAKING_M_S2 * HELD_S
    fall_m_s = (math.sqrt(max(linear**2 + 4.0 * room, 0.0)) - linear) / 2.0
    recovered_m_s2 = (fall_m_s + climb_m_s) / HELD_S
    touched_m_s2 = (TOUCHDOWN_M_S**2 - climb_m_s**2) / (2.0 * height_m)
    return min(max(1.0 - max(recovered_m_s2, touched_m_s2) / GRAVITY_M_S2, 0.0), 1.0)
