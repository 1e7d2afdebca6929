"""Controller and estimator of a vehicle, and their settings."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, NamedTuple

import msgspec

from rcopterx.agents.flight.oscillation import Loop
from rcopterx.bus.intent import FlownBy
from rcopterx.bus.message import Parameters, Setting
from rcopterx.bus.messages import Diagnostics
from rcopterx.bus.requests import Tune
from rcopterx.control.interfaces import Controller, Estimator
from rcopterx.control.plugins import ESTIMATORS, flying
from rcopterx.vehicles.model import Model, with_parameters

DEFAULT_CONTROLLER: Final = "cascade"
DEFAULT_ESTIMATOR: Final = "extended_kalman"  # the defaults of a fleet file, which fly where others fail
EFFORT_FACTORS: Final = "effort_factors"  # controller's setting that lowers bandwidth, one for each `Loop`


class FlownParts(NamedTuple):
    """What flies in a configuration, and what takes the place of a controller or an estimator that fails."""

    model: Model
    controller: Controller
    estimator: Estimator
    default_controller: Controller
    default_estimator: Estimator


@dataclass(frozen=True)
class Configuration:
    """Names and settings; missing settings have their defaults."""

    controller: str = DEFAULT_CONTROLLER
    estimator: str = DEFAULT_ESTIMATOR
    controller_settings: Mapping[str, object] = field(default_factory=dict)
    """Name and settings of the controller, the horizon among them."""
    estimator_settings: Mapping[str, object] = field(default_factory=dict)
    """Name and settings of the estimator."""
    model: Mapping[str, object] = field(default_factory=dict)
    """Parameters of the model that were identified in flight; all others are those of the fleet file."""
    learned: tuple[str, ...] = ()
    """Parts of the model that were learned in ordinary flight."""

    def __post_init__(self) -> None:
        # Rows of numbers are lists in a fleet file and tuples in a message; here they are tuples.
        for name in ("controller_settings", "estimator_settings", "model"):
            settings = getattr(self, name).items()
            plain = {key: tuple(value) if isinstance(value, list) else value for key, value in settings}
            object.__setattr__(self, name, plain)

    @classmethod
    def reported(cls, by: Diagnostics | FlownBy) -> "Configuration":
        """The configuration that an agent reports in its status or its intent."""
        return cls(
            by.controller, by.estimator, by.controller_settings, by.estimator_settings, by.model, by.learned
        )

    @cached_property
    def effort_factors(self) -> tuple[float, ...]:
        """Factors by which the guard against oscillation has raised the input weights of each `Loop`."""
        factors = self.controller_settings.get(EFFORT_FACTORS)
        return tuple(map(float, factors)) if isinstance(factors, tuple) else (1.0,) * len(Loop)

    @cached_property
    def message(self) -> FlownBy:
        """As it travels: settings are numbers, strings and rows of numbers."""
        return FlownBy(
            controller=self.controller,
            controller_settings=msgspec.convert(self.controller_settings, dict[str, Setting]),
            estimator=self.estimator,
            estimator_settings=msgspec.convert(self.estimator_settings, dict[str, Setting]),
            model=msgspec.convert(self.model, Parameters),
            learned=self.learned,
        )

    def changed(self, by: Tune) -> "Configuration":
        """The configuration with added settings and parameters; other parts keep only the horizon."""
        kept = dict(self.controller_settings)
        if by.controller not in (None, self.controller):
            kept = {name: value for name, value in kept.items() if name == "horizon"}
        kept_by_estimator = self.estimator_settings if by.estimator in (None, self.estimator) else {}
        return replace(
            self,
            controller=by.controller or self.controller,
            controller_settings={**kept, **by.controller_settings},
            estimator=by.estimator or self.estimator,
            estimator_settings={**kept_by_estimator, **by.estimator_settings},
            model={**self.model, **by.model},
            learned=by.learned if by.model else self.learned,
        )

    def with_default_controller(self) -> "Configuration":
        """The configuration with the default controller, which keeps the horizon."""
        kept = {name: value for name, value in self.controller_settings.items() if name == "horizon"}
        return replace(self, controller=DEFAULT_CONTROLLER, controller_settings=kept)

    def with_default_estimator(self) -> "Configuration":
        """The configuration with the default estimator."""
        return replace(self, estimator=DEFAULT_ESTIMATOR, estimator_settings={})

    def flown_model(self, model: Model) -> Model:
        """Return the model with the parameters identified in flight; `ValueError` for one it cannot have."""
        flown = with_parameters(model, self.model)
        if self.estimator_settings.get("measured_tilt") is False:
            flown = flown.for_positions_only()
        sizes = [0 if one.tilt is None else one.tilt.dynamics().size for one in (model, flown)]
        if sizes[0] != sizes[1]:
            raise ValueError("tilt: its structure cannot change in flight")
        return flown

    def controller_for(self, model: Model, period_s: float) -> Controller:
        """Build the controller, perhaps a scheme; `ValueError` for an unknown one or a wrong setting."""
        return flying(self.controller).build(
            self.controller, self.flown_model(model), period_s, self.controller_settings
        )

    def estimator_for(self, model: Model, period_s: float) -> Estimator:
        """Build the estimator; `ValueError` for an unknown one or a setting it does not accept."""
        return ESTIMATORS.build(self.estimator, self.flown_model(model), period_s, self.estimator_settings)

    def parts(self, model: Model, period_s: float) -> FlownParts:
        """Build everything for a vehicle; errors as of `controller_for` and `estimator_for`."""
        controller = default_controller = self.controller_for(model, period_s)
        estimator = default_estimator = self.estimator_for(model, period_s)
        if (plain := self.with_default_controller()) != self:
            default_controller = plain.controller_for(model, period_s)
        if (plain := self.with_default_estimator()) != self:
            default_estimator = plain.estimator_for(model, period_s)
        return FlownParts(
            self.flown_model(model), controller, estimator, default_controller, default_estimator
        )
