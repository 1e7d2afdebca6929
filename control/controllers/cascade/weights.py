"""Weights that follow from a vehicle's model and from how far the true vehicle may be from it.

The weight of a stick is the least one of a geometric series with which filter and regulator together bear the
model's uncertainty (`rcopterx.vehicles.model.Uncertainty`): stable with gain, delay, frequency and damping of
the tilt off, each alone and all together, and with a peak of the sensitivity of 2 at most. Where no weight of
the series bears it, it is the one that comes closest. The series begins with a floor. For a vehicle with a
tilt model the floors and the weights of velocities depend on the uncertainty of the gain; a larger weight of
the horizontal velocity, which makes a lightly damped vehicle robust, is tried before softer sticks.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import product
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
STEPS: Final[Grades] = (22, 60)  # its length: no identified helicopter is flown softer than its type
SPEED_STEP: Final = 3.0
SPEEDS: Final = 4  # the same for the weight of the horizontal velocity

HORIZONTAL: Final = slice(0, 2)  # x and y among the four axes x, y, z, yaw


class CascadeWeights(NamedTuple):
    """Weights of the rows of all axes x, y, z, yaw; arrays of shape (4,)."""

    position: Array
    velocity: Array
    effort: Array
    soft: float  # weight of the squared excess over a state bound


class DefaultWeights(NamedTuple):
    """Diagonals of Q (x y z psi xd_B yd_B zd_B psid) and R (pitch, roll, thrust, yaw)."""

    states: tuple[float, ...]
    inputs: Four


@lru_cache(maxsize=64)
def default_weights(model: Model, period_s: float) -> DefaultWeights:
    """Return the weights of a vehicle whose fleet file gives none."""
    graded = model.uncertainty.graded
    positions = _LAG_STATES if model.tilt is None else _TILT_POSITIONS

    def behind_lag(axis: int, rate: float, floor: float) -> float:
        _, effort = _least(
            floor, (rate,), model, lambda *pair: lag_loop(model, period_s, axis, (positions[axis], *pair))
        )
        return effort

    if model.tilt is None:
        pitch, roll, thrust, yaw = (
            behind_lag(axis, _LAG_STATES[4 + axis], floor) for axis, floor in enumerate(LAG_FLOORS)
        )
        return DefaultWeights(_LAG_STATES, (max(pitch, roll), max(pitch, roll), thrust, yaw))
    floor = LOOP_DEMAND_FLOOR if model.tilt.bar_time_constant_s is None else DEMAND_FLOOR
    series = (graded(*SPEED) * SPEED_STEP**step for step in range(SPEEDS))
    speeds = [*(speed for speed in series if speed < max(SPEED)), max(SPEED)]
    speed, demand = _least(
        graded(*floor), speeds, model, lambda *pair: tilt_loop(model, period_s, (positions[0], *pair))
    )
    climb, turn = graded(*CLIMB), graded(*YAW_RATE)
    thrust = behind_lag(U_THRUST, climb, graded(*THRUST_FLOOR))
    yaw = behind_lag(U_YAW, turn, graded(*YAW_FLOOR))
    pitch, roll = (demand * gain**2 for gain in model.input_gain[:2])
    return DefaultWeights((*positions, speed, speed, climb, turn), (pitch, roll, thrust, yaw))


def _least(
    floor: float, rates: Sequence[float], model: Model, loop_with: Callable[..., FeedbackLoop]
) -> tuple[float, float]:
    """Weights of velocity and stick, least of the stick, that bear the uncertainty or fall least short."""
    best, least = (rates[0], floor), math.inf
    for step, rate in product(range(round(model.uncertainty.graded(*STEPS))), rates):
        pair = rate, floor * STEP**step
        shortage = robustness(loop_with(*pair), model.uncertainty).shortage
        if shortage == 0:
            return pair
        if shortage < least:
            best, least = pair, shortage
    return best
