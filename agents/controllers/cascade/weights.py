"""Weights that follow from a vehicle's model and from how far the true vehicle may be from it.

The rule: the weight of a stick is the least one of a geometric row with which filter and regulator together
bear every departure of the model's uncertainty (`rcopterx.vehicles.model.Uncertainty`): gain larger and
smaller, more delay, frequency higher and lower, each alone. The row begins with a floor; of a vehicle with a
tilt model that floor rises with what the gain may be wrong, because a true vehicle departs in everything at
once.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from rcopterx.agents.margins.axes import lag_loop, tilt_loop
from rcopterx.agents.margins.loop import FeedbackLoop
from rcopterx.agents.margins.search import bears
from rcopterx.vehicles.model import UNIDENTIFIED, Model
from rcopterx.vehicles.state import U_THRUST, U_YAW
from rcopterx.vehicles.tuples import Four

_LAG_STATES: Final = (800.0, 800.0, 100.0, 10.0, 1.0, 1.0, 1.0, 1.0)
_TILT_STATES: Final = (100.0, 100.0, 100.0, 10.0, 1.0, 1.0, 1.0)
LAG_FLOORS: Final = (1.5, 1.5, 15.0, 5.0)
"""Least weights of pitch, roll, thrust and yaw of a vehicle without a tilt model."""


@dataclass(frozen=True)
class Floor:
    """Least weight behind a tilt, of a vehicle of which only the type is known and of one known better."""

    unidentified: float
    least: float

    def of(self, model: Model) -> float:
        """For what the gain of this model may be wrong."""
        wrong = (model.uncertainty.gain_factor - 1.0) / (UNIDENTIFIED.gain_factor - 1.0)
        return float(max(self.unidentified * wrong**GAIN_EXPONENT, self.least))


GAIN_EXPONENT: Final = 2.7
DEMAND_FLOOR: Final = Floor(2.4, 0.12)
"""Of the acceleration [1 per (m/s^2)^2] that pitch and roll demand, against 100 of the position."""
THRUST_FLOOR: Final = Floor(100.0, LAG_FLOORS[U_THRUST])
YAW_FLOOR: Final = Floor(800.0, 150.0)
"""Of a yaw stick that asks rotors with a lag for a torque: a loop faster than they are would oscillate."""
YAW_RATE_FLOOR: Final = Floor(5.0, 1.0)
"""Of the yaw rate, which a gyro that is weaker than the model's damps less."""
STEP: Final = 1.5
"""Ratio of the weights of the row."""
STEPS: Final = 24

Eight = tuple[float, float, float, float, float, float, float, float]


def default_state_weights(model: Model) -> Eight:
    """Diagonal of Q: x y z psi xd_B yd_B zd_B psid."""
    return _LAG_STATES if model.tilt is None else (*_TILT_STATES, YAW_RATE_FLOOR.of(model))


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
        return pitch, roll, thrust, yaw
    demand = _least(
        DEMAND_FLOOR.of(model),
        model,
        lambda effort: tilt_loop(model, period_s, (states[0], states[4], effort)),
    )
    pitch, roll = (demand * gain**2 for gain in model.input_gain[:2])
    thrust, yaw = behind_lag(U_THRUST, THRUST_FLOOR.of(model)), behind_lag(U_YAW, YAW_FLOOR.of(model))
    return pitch, roll, thrust, yaw


def _least(floor: float, model: Model, loop_with: Callable[[float], FeedbackLoop]) -> float:
    """Least weight of the row whose loop bears the uncertainty; the last one if none does."""
    row = [floor * STEP**step for step in range(STEPS)]
    return next((weight for weight in row if bears(loop_with(weight), model.uncertainty)), row[-1])
