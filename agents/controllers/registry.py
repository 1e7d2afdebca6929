"""Controllers by name: the built-in ones and those that installed packages add.

A package adds a controller through the entry-point group `rcopterx.controllers`; the entry point names a
class with an attribute `Settings` (a `ControllerSettings` type), built from (model, period_s, settings).
A controller's module is imported only when that controller is asked for; agents start quickly.
"""

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, Protocol

from agents.controllers.settings import ControllerSettings
from agents.interfaces import Controller
from agents.plain_settings import SettingsError, parse_settings
from vehicles.model import Model

ENTRY_POINT_GROUP: Final = "rcopterx.controllers"
BUILT_IN: Final[Mapping[str, str]] = {
    "cascade": "agents.controllers.cascade:CascadeController",
    "lqr": "agents.controllers.lqr:LqrController",
    "paper": "agents.controllers.paper:PaperController",
    "pid": "agents.controllers.pid:PidController",
}
"""Where the built-in controllers are; they work without installed metadata."""
PERIOD_RANGE_S: Final = (0.002, 0.2)


class ControllerClass(Protocol):
    """A class that a controller's name stands for."""

    Settings: type[ControllerSettings]

    def __call__(self, model: Model, period_s: float, settings: Any) -> Controller:
        """Build the controller of one vehicle."""
        ...


def available_controllers() -> list[str]:
    """Names that `build_controller` accepts, sorted; nothing is imported for it."""
    return sorted({*BUILT_IN, *(point.name for point in _installed())})


def load_controller(name: str) -> ControllerClass:
    """Import the class of a controller.

    Parameters
    ----------
    name
        One of `available_controllers`.

    Returns
    -------
    ControllerClass
        The class, with its `Settings`.

    Raises
    ------
    SettingsError
        No controller of that name, or its package cannot be imported.
    """
    path = BUILT_IN.get(name)
    if path is not None:
        module, attribute = path.split(":")
        built_in: ControllerClass = getattr(import_module(module), attribute)
        return built_in
    for point in _installed():
        if point.name == name:
            try:
                added: ControllerClass = point.load()
            except (ImportError, AttributeError) as error:
                raise SettingsError(
                    f"controller {name!r} ({point.value}) cannot be imported: {error}"
                ) from error
            return added
    raise SettingsError(f"no controller is called {name!r}; allowed are {', '.join(available_controllers())}")


def build_controller(name: str, model: Model, period_s: float, settings: Mapping[str, object]) -> Controller:
    """Build a vehicle's controller from plain data.

    Parameters
    ----------
    name
        One of `available_controllers`.
    model
        The vehicle.
    period_s
        Control period T_s.
    settings
        Names and values of the controller's settings; what is left out keeps its default.

    Returns
    -------
    Controller
        Ready to be reset and stepped.

    Raises
    ------
    SettingsError
        Unknown controller or a setting that is not allowed.
    """
    controller_class = load_controller(name)
    lowest, highest = PERIOD_RANGE_S
    if not lowest <= period_s <= highest:
        raise SettingsError(f"period_s must be from {lowest} to {highest} s, got {period_s}")
    try:
        return controller_class(model, period_s, parse_settings(controller_class.Settings, settings))
    except SettingsError as error:
        raise SettingsError(f"controller {name!r}: {error}") from error


def _installed() -> list[EntryPoint]:
    return [point for point in entry_points(group=ENTRY_POINT_GROUP) if point.name not in BUILT_IN]
