"""Weights that follow from a vehicle's model and from how far the true vehicle may be from it.

The rule, checked by `tests/agents/controllers/test_weights.py` against the margins it promises: with a tilt
model the weight of the sticks rises with the power `GAIN_EXPONENT` of what the gain may be wrong, so that
filter and regulator together stay stable when gain, delay and frequency of the tilt are off by the model's
uncertainty.
"""

from typing import Final

from vehicles.model import UNIDENTIFIED, Model

_LAG_STATES: Final = (800.0, 800.0, 100.0, 10.0, 1.0, 1.0, 1.0, 1.0)
_LAG_INPUTS: Final = (1.5, 1.5, 15.0, 5.0)
_TILT_STATES: Final = (100.0, 100.0, 100.0, 10.0, 1.0, 1.0, 1.0, 1.0)
STICK_WEIGHT: Final = 10.0
"""Of pitch and roll of a vehicle of which only the type is known, against 100 of the position."""
GAIN_EXPONENT: Final = 2.7
LEAST_STICK_WEIGHT: Final = 0.5
YAW_WEIGHT: Final = 100.0
"""Of a yaw stick that asks rotors with a lag for a torque: a loop faster than they are would oscillate."""

Eight = tuple[float, float, float, float, float, float, float, float]
Four = tuple[float, float, float, float]


def default_state_weights(model: Model) -> Eight:
    """Diagonal of Q: x y z psi xd_B yd_B zd_B psid."""
    return _LAG_STATES if model.tilt is None else _TILT_STATES


def default_input_weights(model: Model) -> Four:
    """Diagonal of R: pitch, roll, thrust, yaw."""
    if model.tilt is None:
        return _LAG_INPUTS
    wrong = (model.uncertainty.gain_factor - 1.0) / (UNIDENTIFIED.gain_factor - 1.0)
    stick = max(STICK_WEIGHT * wrong**GAIN_EXPONENT, LEAST_STICK_WEIGHT)
    return (stick, stick, _LAG_INPUTS[2], YAW_WEIGHT)
