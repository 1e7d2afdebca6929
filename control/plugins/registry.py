"""Controllers and estimators by name: the built-in ones and those of installed packages."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, Generic, Protocol, TypeVar

import msgspec

from rcopterx.control.plugins.plain_settings import SettingsError, parse_settings
from rcopterx.vehicles.model import Model

PERIOD_RANGE_S: Final = (0.002, 0.2)

Part = TypeVar("Part")
Built = TypeVar("Built", covariant=True)


class PartClass(Protocol[Built]):
    """A class that a name stands for."""

    Settings: type[msgspec.Struct]

    def __call__(self, model: Model, period_s: float, settings: Any) -> Built:
        """Build the part for one vehicle."""
        ...


@dataclass(frozen=True)
class Registry(Generic[Part]):
    """Classes of one kind by name; a class is imported on its first use.

    Attributes
    ----------
    kind
        `controller` or `estimator`, for error messages.
    entry_point_group
        Group of entry points by which packages add classes.
    built_in
        Modules and classes that work without installed metadata: `package.module:Class`.
    """

    kind: str
    entry_point_group: str
    built_in: Mapping[str, str]

    def available(self) -> list[str]:
        """Return the names that `load` and `build` accept, sorted; imports nothing."""
        return sorted({*self.built_in, *(point.name for point in self._installed())})

    def built_in_module(self, name: str) -> str | None:
        """Return the module of a built-in name, None for any other name."""
        path = self.built_in.get(name)
        return None if path is None else path.partition(":")[0]

    def load(self, name: str) -> PartClass[Part]:
        """Import the class of a name.

        Raises `SettingsError` for an unknown name (the message lists what is allowed), or a failed import.
        """
        path = self.built_in.get(name)
        if path is not None:
            module, attribute = path.split(":")
            built_in: PartClass[Part] = getattr(import_module(module), attribute)
            return built_in
        for point in self._installed():
            if point.name == name:
                try:
                    added: PartClass[Part] = point.load()
                except (ImportError, AttributeError) as error:
                    raise SettingsError(
                        f"{self.kind} {name!r} ({point.value}) cannot be imported: {error}"
                    ) from error
                return added
        raise SettingsError(f"no {self.kind} is called {name!r}; allowed are {', '.join(self.available())}")

    def build(self, name: str, model: Model, period_s: float, settings: Mapping[str, object]) -> Part:
        """Build the part of one vehicle; `settings` that are left out keep their defaults.

        Raises `SettingsError` for an unknown name, or a setting that is not allowed.
        """
        part_class = self.load(name)
        lowest, highest = PERIOD_RANGE_S
        if not lowest <= period_s <= highest:
            raise SettingsError(f"period_s must be from {lowest} to {highest} s, got {period_s}")
        try:
            return part_class(model, period_s, parse_settings(part_class.Settings, settings))
        except ValueError as error:
            raise SettingsError(f"{self.kind} {name!r}: {error}") from error

    def _installed(self) -> list[EntryPoint]:
        return [
            point for point in entry_points(group=self.entry_point_group) if point.name not in self.built_in
        ]
