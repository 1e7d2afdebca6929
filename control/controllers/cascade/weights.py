"""Weights that follow from a vehicle's model and from how far the true vehicle may be from it.

The weight of a stick is the least one of a geometric series with which filter and regulator together bear the
model's uncertainty (`rcopterx.vehicles.model.Uncertainty`): stable with gain, delay, frequency and damping of
the tilt off, each alone, with a peak of the sensitivity of 5 at most at all joint corners, and of 2 around
the model. Where no weight of the series bears it, it is the one that comes closest. Series begin with a
floor. For a vehicle with a tilt model larger weights of the horizontal velocity, which make a lightly damped
vehicle robust, are tried before softer sticks. The same series serve every uncertainty, so that a vehicle
that is known better is not flown softer.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import product
from typing import Final, NamedTuple

from rcopterx.control.estimators.settings import ExtendedKalmanSettings
from rcopterx.control.margins.axes import lag_loop, tilt_loop
from rcopterx.control.margins.loop import FeedbackLoop, robustness
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import U_THRUST, U_YAW, Array
from rcopterx.vehicles.tuples import Four

_LAG_STATES: Final = (800.0, 800.0, 100.0, 10.0, 1.0, 1.0, 40.0, 1.0)
_TILT_POSITIONS: Final = (100.0, 100.0, 100.0, 10.0)
LAG_FLOORS: Final = (1.5, 1.5, 5.0, 5.0)  # least weights of pitch, roll, thrust, yaw without a tilt model


Grades = tuple[float, float]  # values of an identified and an unidentified vehicle (`Departures.graded`)

DEMAND_FLOOR: Final = 0.24  # least weight of the demand [1 per (m/s^2)^2]; position: 100
LOOP_DEMAND_FLOOR: Final = 0.06  # the same without a stabilizer bar, with an attitude loop
SPEEDS: Final = (1.0, 5.0, 25.0)  # weights of the horizontal velocity
THRUST_FLOOR: Final[Grades] = (15.0, 40.0)
YAW_FLOOR: Final[Grades] = (150.0, 60.0)
CLIMB: Final[Grades] = (1.0, 10.0)
YAW_RATE: Final[Grades] = (1.0, 0.2)
STEP: Final = 1.15  # ratio of the weights of a series
STEPS: Final = 60  # its largest length
LARGEST_DEMAND: Final[Grades] = (0.64, 1000.0)  # no identified helicopter is flown softer than its type

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
    positions = _LAG_STATES if model.tilt is None else _TILT_POSITIONS
    known = model.uncertainty.axes
    estimator = ExtendedKalmanSettings(measured_tilt=model.tilt_measured)

    def behind_lag(axis: int, rate: float, floor: float) -> float:
        _, effort = _least(
            floor, math.inf, (rate,), lambda *pair: lag_loop(model, period_s, axis, (positions[axis], *pair))
        )
        return effort

    if model.tilt is None:
        pitch, roll, thrust, yaw = (
            behind_lag(axis, _LAG_STATES[4 + axis], floor) for axis, floor in enumerate(LAG_FLOORS)
        )
        return DefaultWeights(_LAG_STATES, (max(pitch, roll), max(pitch, roll), thrust, yaw))
    speed, demand = _least(
        LOOP_DEMAND_FLOOR if model.tilt.bar_time_constant_s is None else DEMAND_FLOOR,
        known[0].graded(*LARGEST_DEMAND),
        SPEEDS,
        lambda *pair: tilt_loop(model, period_s, (positions[0], *pair), estimator),
    )
    climb, turn = known[U_THRUST].graded(*CLIMB), known[U_YAW].graded(*YAW_RATE)
    thrust = behind_lag(U_THRUST, climb, known[U_THRUST].graded(*THRUST_FLOOR))
    yaw = behind_lag(U_YAW, turn, known[U_YAW].graded(*YAW_FLOOR))
    pitch, roll = (demand * gain**2 for gain in model.input_gain[:2])
    return DefaultWeights((*positions, speed, speed, climb, turn), (pitch, roll, thrust, yaw))


def _least(
    floor: float, largest: float, rates: Sequence[float], loop_with: Callable[..., FeedbackLoop]
) -> tuple[float, float]:
    """Weights of velocity and stick, least of the stick, that bear the uncertainty or fall least short."""
    best, least = (rates[0], floor), math.inf
    efforts = [effort for step in range(STEPS) if (effort := floor * STEP**step) <= largest]
    for effort, rate in product(efforts, rates):
        pair = rate, effort
        shortage = robustness(loop_with(*pair)).shortage
        if shortage == 0:
            return pair
        if shortage < least:
            best, least = pair, shortage
    return best
