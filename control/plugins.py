"""Controllers and estimators by name: the built-in ones and those that installed packages add.

A package adds a controller through the entry-point group `rcopterx.controllers`, a scheme through
`rcopterx.schemes`, an estimator through `rcopterx.estimators`; the entry point names a class with an
attribute `Settings` (a `ControllerSettings` type for a controller, else a `msgspec.Struct` type), built from
(model, period_s, settings). For an estimator, `period_s` is the nominal time between calls of `predict`. Its
module is imported only when it is needed, so that agents start quickly.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, Generic, Protocol, TypeVar

import msgspec

from rcopterx.control.interfaces import Controller, Estimator
from rcopterx.control.scheme import Scheme
from rcopterx.user_text import described, similar
from rcopterx.vehicles.model import Model


class SettingsError(ValueError):
    """A setting is missing, of the wrong type, or outside what is allowed."""


Settings = TypeVar("Settings", bound=msgspec.Struct)


def parse_settings(kind: type[Settings], values: Mapping[str, object]) -> Settings:
    """Convert names and values into settings of a type; else `SettingsError`. Missing ones keep defaults."""
    unknown = sorted(set(values) - set(kind.__struct_fields__))
    if unknown:
        raise SettingsError(
            f"unknown setting {unknown[0]!r}; allowed are {', '.join(kind.__struct_fields__)}"
            f"{similar(unknown[0], kind.__struct_fields__)}"
        )
    for name, value in values.items():
        if not all_finite(value):
            raise SettingsError(f"{name}: every number must be finite, got {value}")
    try:
        return msgspec.convert(dict(values), kind)
    except msgspec.ValidationError as error:
        raise SettingsError(str(error)) from error


def all_finite(value: object) -> bool:
    """Return whether every number in nested lists, tuples and tables is finite."""
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, dict):
        return all(map(all_finite, value.values()))
    return not isinstance(value, list | tuple) or all(map(all_finite, value))


# what `rcopterx-studies` adds, which need not be installed to fly
OF_STUDIES: Final = (
    *("lqr", "paper", "finite_difference", "kalman"),
    *("admm", "consensus", "distributed_lqr", "event_triggered", "on_demand"),
)
PERIOD_RANGE_S: Final = (0.002, 0.2)

Part = TypeVar("Part", covariant=True)


class PartClass(Protocol[Part]):
    """A class that a name stands for."""

    Settings: type[msgspec.Struct]

    def __call__(self, model: Model, period_s: float, settings: Any) -> Part:
        """Build the part for one vehicle."""


@dataclass(frozen=True)
class Registry(Generic[Part]):
    """Classes of one kind by name; a class is imported on its first use."""

    kind: str  # `controller`, `estimator` or `scheme`, for error messages
    entry_point_group: str  # group of entry points by which packages add classes
    # modules and classes that work without installed metadata: `package.module:Class`
    built_in: Mapping[str, str]

    def available(self) -> list[str]:
        """Return the names that `load` and `build` accept, sorted; imports nothing."""
        return sorted({*self.built_in, *(point.name for point in self._installed())})

    def load(self, name: str) -> PartClass[Part]:
        """Import the class of a name.

        Raises `SettingsError` for an unknown name (the message lists what is allowed), a failed import, or a
        class without `Settings`.
        """
        path = self.built_in.get(name)
        points = self._installed() if path is None else [EntryPoint(name, path, self.entry_point_group)]
        for point in points:
            if point.name == name:
                try:
                    found: PartClass[Part] = point.load()
                except Exception as error:  # a plug-in may raise anything
                    raise SettingsError(
                        f"{self.kind} {name!r} ({point.value}) cannot be imported: {described(error)}"
                    ) from error
                if not hasattr(found, "Settings"):
                    raise SettingsError(f"{self.kind} {name!r} ({point.value}) has no attribute Settings")
                return found
        if name in OF_STUDIES:
            raise SettingsError(
                f"{self.kind} {name!r}: part of rcopterx-studies: pip install rcopterx-studies"
            )
        known = self.available()
        raise SettingsError(
            f"no {self.kind} is called {name!r}; allowed are {', '.join(known)}{similar(name, known)}"
        )

    def build(self, name: str, model: Model, period_s: float, settings: Mapping[str, object]) -> Part:
        """Build the part of one vehicle; `SettingsError` for an unknown name or a setting not allowed."""
        part_class = self.load(name)
        lowest, highest = PERIOD_RANGE_S
        if not lowest <= period_s <= highest:
            raise SettingsError(f"period_s must be from {lowest} to {highest} s, got {period_s}")
        try:
            return part_class(model, period_s, parse_settings(part_class.Settings, settings))
        except ValueError as error:
            raise SettingsError(f"{self.kind} {name!r}: {error}") from error

    def _installed(self) -> list[EntryPoint]:
        return [one for one in entry_points(group=self.entry_point_group) if one.name not in self.built_in]


CONTROLLERS: Final = Registry[Controller](
    "controller",
    "rcopterx.controllers",
    {
        "cascade": "rcopterx.control.controllers.cascade.controller:CascadeController",
        "pid": "rcopterx.control.controllers.feedback:PidController",
    },
)
ESTIMATORS: Final = Registry[Estimator](
    "estimator",
    "rcopterx.estimators",
    {"extended_kalman": "rcopterx.control.estimators.extended_kalman:ExtendedKalmanEstimator"},
)
SCHEMES: Final = Registry[Scheme]("scheme", "rcopterx.schemes", {})


def is_built_in(controller: Controller) -> bool:
    """Return whether a controller is part of rcopterx, or of the baselines of rcopterx-studies."""
    return type(controller).__module__.startswith(("rcopterx.control.", "rcopterx_studies.baselines."))


def flying(name: str) -> Registry[Controller]:
    """Return the registry of a controller or scheme; that of controllers for an unknown name."""
    return SCHEMES if name in SCHEMES.available() else CONTROLLERS
