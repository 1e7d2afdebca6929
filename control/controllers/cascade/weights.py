"""Weights that follow from a vehicle's model and from how far the true vehicle may be from it.

The weight of a stick is the least one of a geometric series with which filter and regulator together bear the
model's uncertainty (`rcopterx.vehicles.model.Uncertainty`): stable with gain, delay, frequency and damping of
the tilt off, each alone and all together, and with a peak of the sensitivity of 2 at most. Where no weight of
the series bears it, it is the one that comes closest. The series begins with a floor. For a vehicle with a
tilt model the floors and the weights of velocities depend on the uncertainty of the gain.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Final, NamedTuple

from rcopterx.control.margins.axes import lag_loop, tilt_loop
from rcopterx.control.margins.loop import FeedbackLoop, robustness
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_THRUST, U_YAW, Array
from rcopterx.vehicles.tuples import Four

_LAG_STATES: Final = (800.0, 800.0, 100.0, 10.0, 1.0, 1.0, 40.0, 1.0)
_TILT_POSITIONS: Final = (100.0, 100.0, 100.0, 10.0)
LAG_FLOORS: Final = (1.5, 1.5, 5.0, 5.0)  # least weights of pitch, roll, thrust, yaw without a tilt model


Grades = tuple[float, float]  # values of an identified and an unidentified vehicle (`Uncertainty.graded`)

DEMAND_FLOOR: Final[Grades] = (0.24, 0.8)  # least weight of the demand [1 per (m/s^2)^2]; position: 100
LOOP_DEMAND_FLOOR: Final[Grades] = (0.06, 1.5)  # the same without a stabilizer bar, with an attitude loop
THRUST_FLOOR: Final[Grades] = (15.0, 40.0)
YAW_FLOOR: Final[Grades] = (150.0, 60.0)
SPEED: Final[Grades] = (1.0, 40.0)  # weight of the horizontal velocity
CLIMB: Final[Grades] = (1.0, 10.0)
YAW_RATE: Final[Grades] = (1.0, 0.2)
STEP: Final = 1.15  # ratio of the weights of the series
STEPS: Final = 60

HORIZONTAL: Final = slice(0, 2)  # x and y among the four axes x, y, z, yaw


class CascadeWeights(NamedTuple):
    """Weights of the rows of all axes x, y, z, yaw; arrays of shape (4,)."""

    position: Array
    velocity: Array
    effort: Array
    soft: float  # weight of the squared excess over a state bound


def default_state_weights(model: Model) -> tuple[float, ...]:
    """Diagonal of Q: x y z psi xd_B yd_B zd_B psid."""
    if model.tilt is None:
        return _LAG_STATES
    speed, climb, yaw_rate = (model.uncertainty.graded(*grades) for grades in (SPEED, CLIMB, YAW_RATE))
    return (*_TILT_POSITIONS, speed, speed, climb, yaw_rate)


@lru_cache(maxsize=64)
def default_input_weights(model: Model, period_s: float) -> Four:
    """Diagonal of R: pitch, roll, thrust, yaw."""
    states = default_state_weights(model)

    def behind_lag(axis: int, floor: float) -> float:
        position, velocity = states[axis], states[4 + axis]
        return _least(
            floor, model, lambda effort: lag_loop(model, period_s, axis, (position, velocity, effort))
        )

    if model.tilt is None:
        pitch, roll, thrust, yaw = (behind_lag(axis, floor) for axis, floor in enumerate(LAG_FLOORS))
        return max(pitch, roll), max(pitch, roll), thrust, yaw
    floor = LOOP_DEMAND_FLOOR if model.tilt.bar_time_constant_s is None else DEMAND_FLOOR
    demand = _least(
        model.uncertainty.graded(*floor),
        model,
        lambda effort: tilt_loop(model, period_s, (states[0], states[4], effort)),
    )
    pitch, roll = (demand * gain**2 for gain in model.input_gain[:2])
    thrust = behind_lag(U_THRUST, model.uncertainty.graded(*THRUST_FLOOR))
    yaw = behind_lag(U_YAW, model.uncertainty.graded(*YAW_FLOOR))
    return pitch, roll, thrust, yaw


def _least(floor: float, model: Model, loop_with: Callable[[float], FeedbackLoop]) -> float:
    """Least weight of the series whose loop bears the uncertainty, or falls least short of it."""
    best, least = floor, math.inf
    for step in range(STEPS):
        weight = floor * STEP**step
        shortage = robustness(loop_with(weight), model.uncertainty).shortage
        if shortage == 0:
            return weight
        if shortage < least:
            best, least = weight, shortage
    return best
