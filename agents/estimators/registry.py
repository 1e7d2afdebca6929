"""Estimators by name: the built-in ones and those that installed packages add.

A package adds an estimator through the entry-point group `rcopterx.estimators`; the entry point names a class
with an attribute `Settings` (a `msgspec.Struct` type) that is built from (model, period_s, settings).
An estimator's module is imported only when that estimator is asked for.
"""

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Final, Protocol

import msgspec

from agents.interfaces import Estimator
from agents.plain_settings import parse_settings
from vehicles.model import Model

ENTRY_POINT_GROUP: Final = "rcopterx.estimators"
BUILT_IN: Final[Mapping[str, str]] = {
    "extended_kalman": "agents.estimators.extended_kalman:ExtendedKalmanEstimator",
    "finite_difference": "agents.estimators.finite_difference:FiniteDifferenceEstimator",
    "kalman": "agents.estimators.kalman:KalmanEstimator",
}
"""Where the built-in estimators are; they work without installed metadata."""
PERIOD_RANGE_S: Final = (0.002, 0.2)


class EstimatorClass(Protocol):
    """A class that an estimator's name stands for."""

    Settings: type[msgspec.Struct]

    def __call__(self, model: Model, period_s: float, settings: Any) -> Estimator:
        """Build the estimator of one vehicle."""
        ...


def available_estimators() -> list[str]:
    """Names that `build_estimator` accepts, sorted; nothing is imported for it."""
    return sorted({*BUILT_IN, *(point.name for point in _installed())})


def load_estimator(name: str) -> EstimatorClass:
    """Import the class of an estimator.

    Parameters
    ----------
    name
        One of `available_estimators`.

    Returns
    -------
    EstimatorClass
        The class, with its `Settings`.

    Raises
    ------
    ValueError
        No estimator of that name (the message lists what is allowed), or its package cannot be imported.
    """
    path = BUILT_IN.get(name)
    if path is not None:
        module, attribute = path.split(":")
        built_in: EstimatorClass = getattr(import_module(module), attribute)
        return built_in
    for point in _installed():
        if point.name == name:
            try:
                added: EstimatorClass = point.load()
            except (ImportError, AttributeError) as error:
                raise ValueError(f"estimator {name!r} ({point.value}) cannot be imported: {error}") from error
            return added
    raise ValueError(f"no estimator is called {name!r}; allowed are {', '.join(available_estimators())}")


def build_estimator(name: str, model: Model, period_s: float, settings: Mapping[str, object]) -> Estimator:
    """Build a vehicle's estimator from plain data.

    Parameters
    ----------
    name
        One of `available_estimators`.
    model
        The vehicle.
    period_s
        Nominal time between calls of `predict`.
    settings
        Names and values of the estimator's settings; what is left out keeps its default.

    Returns
    -------
    Estimator
        Ready to be reset.

    Raises
    ------
    ValueError
        Unknown estimator or a setting that is not allowed.
    """
    estimator_class = load_estimator(name)
    lowest, highest = PERIOD_RANGE_S
    if not lowest <= period_s <= highest:
        raise ValueError(f"period_s must be from {lowest} to {highest} s, got {period_s}")
    try:
        return estimator_class(model, period_s, parse_settings(estimator_class.Settings, settings))
    except ValueError as error:
        raise ValueError(f"estimator {name!r}: {error}") from error


def _installed() -> list[EntryPoint]:
    return [point for point in entry_points(group=ENTRY_POINT_GROUP) if point.name not in BUILT_IN]
