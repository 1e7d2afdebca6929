"""Weights of the cascade as factors of the defaults of a vehicle's model, with undo."""

from collections.abc import Callable, Mapping
from typing import Final

from rcopterx.bus.message import Setting
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.vehicles.state import XD_BODY, YAW, YAW_RATE, YD_BODY, ZD_BODY, X, Y, Z

_STATES: Final[Mapping[str, tuple[int, ...]]] = {
    "position": (X, Y, Z),
    "velocity": (XD_BODY, YD_BODY, ZD_BODY),
    "heading": (YAW, YAW_RATE),
}
EFFORT: Final = "sticks"
GROUPS: Final = (*_STATES, EFFORT)  # names of the factors on the weights of the cascade
CASCADE: Final = "cascade"

Tune = Callable[[str, str, Mapping[str, Setting]], bool]  # vehicle, controller, settings -> accepted


class Weights:
    """Factors on the default weights of one vehicle; `powers` are those in use."""

    def __init__(self, fleet: Fleet, name: str, tune: Tune) -> None:
        self._fleet, self._name, self._tune = fleet, name, tune
        self.powers: Mapping[str, float] = dict.fromkeys(GROUPS, 0.0)
        self._history: list[tuple[Mapping[str, float], str, Mapping[str, Setting]]] = []  # before each change

    def apply(self, powers: Mapping[str, float]) -> None:
        """Fly with the defaults times these powers of 2, by group of `GROUPS`."""
        default, agent = self._default(), self._fleet[self._name].state.agent
        before, settings = CASCADE, dict[str, Setting](default)
        if agent is not None:
            before = agent.diagnostics.controller
            # Weights that no setting gives are the default ones.
            settings = (settings if before == CASCADE else {}) | agent.diagnostics.controller_settings
        factors = {index: 2.0 ** powers[group] for group, indices in _STATES.items() for index in indices}
        states = tuple(weight * factors.get(i, 1.0) for i, weight in enumerate(default["state_weights"]))
        inputs = tuple(weight * 2.0 ** powers[EFFORT] for weight in default["input_weights"])
        if self._tune(self._name, CASCADE, {"state_weights": states, "input_weights": inputs}):
            self._history.append((self.powers, before, settings))
            self.powers = powers

    def undo(self) -> None:
        """Fly as before the last change."""
        if self._history:
            powers, controller, settings = self._history[-1]
            if self._tune(self._name, controller, settings):
                self._history.pop()
                self.powers = powers

    def _default(self) -> dict[str, tuple[float, ...]]:
        """Default weights of the cascade for the model with which the vehicle flies."""
        # Compiled kernels take longer to import than the rest of the page.
        from rcopterx.agents.tuning.configuration import Configuration
        from rcopterx.control.controllers.cascade.weights import default_weights

        file, agent = self._fleet.file, self._fleet[self._name].state.agent
        model = model_of(file, self._name)
        if agent is not None:
            model = Configuration.reported(agent.diagnostics).flown_model(model)
        default = default_weights(model, file.vehicles[self._name].control.period_s)
        return {"state_weights": default.states, "input_weights": default.inputs}
