"""Weights of the cascade as factors of the defaults, which depend on the vehicle's model."""

from collections.abc import Mapping
from typing import Final

from rcopterx.fleet.schema import FleetFile
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.vehicles.state import XD_BODY, YAW, YAW_RATE, YD_BODY, ZD_BODY, X, Y, Z

_STATES: Final[Mapping[str, tuple[int, ...]]] = {
    "position": (X, Y, Z),
    "velocity": (XD_BODY, YD_BODY, ZD_BODY),
    "heading": (YAW, YAW_RATE),
}
EFFORT: Final = "sticks"
GROUPS: Final = (*_STATES, EFFORT)
"""Names of the factors."""


def weights_of(
    fleet: FleetFile, name: str, period_s: float, powers: Mapping[str, float]
) -> dict[str, tuple[float, ...]]:
    """Settings of the cascade: default weights times 2 to the given power for each of `GROUPS`."""
    # Compiled kernels take longer to import than the rest of the page.
    from rcopterx.control.controllers.cascade.weights import default_input_weights, default_state_weights

    model = model_of(fleet, name)
    states = list(default_state_weights(model))
    for group, indices in _STATES.items():
        for index in indices:
            states[index] *= 2.0 ** powers[group]
    inputs = (weight * 2.0 ** powers[EFFORT] for weight in default_input_weights(model, period_s))
    return {"state_weights": tuple(states), "input_weights": tuple(inputs)}
