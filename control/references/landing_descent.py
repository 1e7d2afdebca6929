"""Reference of a landing: down to just above the floor, then slowly until the vehicle is seen to stand."""

import math
from typing import Final

import numpy as np

from rcopterx.control.references.columns import COLUMNS, POSITION, VELOCITY, YAW
from rcopterx.control.references.quintic import PEAK_TO_MEAN_SPEED
from rcopterx.control.references.set_points import ProfileTransition, smooth_move, transition_through
from rcopterx.vehicles.state import Array, Z

DESCENT_SPEED_M_S: Final = 0.7
DESCENT_ACCELERATION_M_S2: Final = 0.8
FLARE_M: Final = 0.2  # height above the floor from which the vehicle descends slowly
TOUCHDOWN_SPEED_M_S: Final = 0.25
SHORTEST_FAST_M: Final = 0.1  # over less, a vehicle at rest would have to jerk to reach the slow speed
DEPTH_M: Final = 0.3  # the reference ends so far below the floor, where the vehicle is seen to be stopped
_PEAK_ACCELERATION = 10 / math.sqrt(3)  # of a quintic from rest to rest, times duration^2 / distance


def descent(start_m: Array, floor_m: float, yaw_rad: float, start_s: float) -> ProfileTransition:
    """Descend straight from rest at `start_m`, shape (3,), through the floor, whose height is `floor_m`."""
    end_m = np.array([start_m[0], start_m[1], floor_m - DEPTH_M])
    fast_m = float(start_m[2]) - floor_m - FLARE_M
    if fast_m < SHORTEST_FAST_M:
        return smooth_move(start_m, end_m, yaw_rad, start_s, TOUCHDOWN_SPEED_M_S)
    fast_s = max(
        PEAK_TO_MEAN_SPEED * fast_m / DESCENT_SPEED_M_S,
        math.sqrt(_PEAK_ACCELERATION * fast_m / DESCENT_ACCELERATION_M_S2),
    )
    slow_s = 2.0 * (FLARE_M + DEPTH_M) / TOUCHDOWN_SPEED_M_S  # to rest, at an even deceleration
    begin, flare, end = np.zeros((3, COLUMNS))
    for knot, place_m in ((begin, start_m), (flare, end_m), (end, end_m)):
        knot[POSITION], knot[YAW] = place_m, yaw_rad
    flare[POSITION][Z] = floor_m + FLARE_M
    flare[VELOCITY][Z] = -TOUCHDOWN_SPEED_M_S
    return transition_through(start_s, (0.0, begin), (fast_s, flare), (fast_s + slow_s, end))
