"""Weights that follow from a vehicle's model and from how far the true vehicle may be from it.

The rule: the weight of a stick is the least one of a geometric row with which filter and regulator together
bear every departure of the model's uncertainty (`rcopterx.vehicles.model.Uncertainty`): gain larger and
smaller, more delay, frequency higher and lower, each alone. The row begins with a floor; behind a tilt that
floor rises with what the gain may be wrong, because a true vehicle departs in everything at once.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Final

from rcopterx.agents.margins.axes import lag_loop, tilt_loop
from rcopterx.agents.margins.loop import FeedbackLoop
from rcopterx.agents.margins.search import bears
from rcopterx.vehicles.model import UNIDENTIFIED, Model
from rcopterx.vehicles.state import U_PITCH, U_ROLL, U_THRUST, U_YAW
from rcopterx.vehicles.tuples import Four

_LAG_STATES: Final = (800.0, 800.0, 100.0, 10.0, 1.0, 1.0, 1.0, 1.0)
_TILT_STATES: Final = (100.0, 100.0, 100.0, 10.0, 1.0, 1.0, 1.0, 1.0)
LAG_FLOORS: Final = (1.5, 1.5, 15.0, 5.0)
"""Least weights of pitch, roll, thrust and yaw."""
DEMAND_FLOOR: Final = 2.4
"""Least weight of the acceleration [1 per (m/s^2)^2] that pitch and roll demand of a vehicle of which only
the type is known, against 100 of the position."""
GAIN_EXPONENT: Final = 2.7
LEAST_DEMAND_FLOOR: Final = 0.12
YAW_FLOOR: Final = 150.0
"""Of a yaw stick that asks rotors with a lag for a torque: a loop faster than they are would oscillate."""
STEP: Final = 1.5
"""Ratio of the weights of the row."""
STEPS: Final = 24

Eight = tuple[float, float, float, float, float, float, float, float]


def default_state_weights(model: Model) -> Eight:
    """Diagonal of Q: x y z psi xd_B yd_B zd_B psid."""
    return _LAG_STATES if model.tilt is None else _TILT_STATES


@lru_cache(maxsize=64)
def default_input_weights(model: Model, period_s: float) -> Four:
    """Diagonal of R: pitch, roll, thrust, yaw."""
    states = default_state_weights(model)

    def behind_lag(axis: int, floor: float) -> float:
        position, velocity = states[axis], states[4 + axis]
        return _least(
            floor, model, lambda effort: lag_loop(model, period_s, axis, (position, velocity, effort))
        )

    thrust = behind_lag(U_THRUST, LAG_FLOORS[U_THRUST])
    if model.tilt is None:
        pitch, roll = (behind_lag(axis, LAG_FLOORS[axis]) for axis in (U_PITCH, U_ROLL))
        return pitch, roll, thrust, behind_lag(U_YAW, LAG_FLOORS[U_YAW])
    wrong = (model.uncertainty.gain_factor - 1.0) / (UNIDENTIFIED.gain_factor - 1.0)
    floor = max(DEMAND_FLOOR * wrong**GAIN_EXPONENT, LEAST_DEMAND_FLOOR)
    demand = _least(floor, model, lambda effort: tilt_loop(model, period_s, (states[0], states[4], effort)))
    pitch, roll = (demand * gain**2 for gain in model.input_gain[:2])
    return pitch, roll, thrust, behind_lag(U_YAW, YAW_FLOOR)


def _least(floor: float, model: Model, loop_with: Callable[[float], FeedbackLoop]) -> float:
    """Least weight of the row whose loop bears the uncertainty; the last one if none does."""
    row = [floor * STEP**step for step in range(STEPS)]
    return next((weight for weight in row if bears(loop_with(weight), model.uncertainty)), row[-1])
