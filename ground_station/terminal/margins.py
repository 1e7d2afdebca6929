"""Stability margins of the vehicles of a fleet."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any, Final

from rcopterx.agents.tuning.configuration import DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR, Configuration
from rcopterx.control.margins.cascade import loops_of
from rcopterx.control.margins.loop import (
    DELAY_LIMIT_S,
    FREQUENCY_LIMIT,
    GAIN_LIMIT,
    PHASE_LIMIT_RAD,
    SENSITIVITY_LIMIT,
    FeedbackLoop,
    margins,
    robustness,
)
from rcopterx.deploy.roles.agent import configured
from rcopterx.fleet.schema import FleetFile, errors_at
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.ground_station.scripting.fleet import Fleet

COLUMNS: Final = (
    "vehicle", "axis", "gain up", "gain down", "phase [deg]", "delay [ms]", "freq. up", "freq. down",
    "peak M_s", "corner M_s", "below rule",
)  # fmt: skip
_NEARLY: Final = 0.999


def fleet_margins(file: FleetFile, vehicles: Iterable[str]) -> dict[str, Any]:
    """Margins of vehicles as their fleet file configures them, as a JSON document.

    It has `fleet`, and `vehicles` by name with `axes`, among their numbers `rule`, the margins required by
    the uncertainty of the model; unknown `axes` are null, and `unknown` says why. May raise `FleetError`.
    """
    return {"fleet": file.name, "vehicles": {name: _vehicle_margins(file, name) for name in vehicles}}


def _vehicle_margins(file: FleetFile, name: str) -> dict[str, Any]:
    used = configured(file, name)
    table: dict[str, Any] = {
        "controller": used.controller,
        "estimator": used.estimator,
        "unknown": unknown_loops(used),
        "axes": None,
    }
    if table["unknown"] is None:
        with errors_at(f"vehicles.{name}.control", ValueError):
            loops = _loops(file, name, used)
        table["axes"] = {axis: asdict(margins(loop)) | _borne(loop) for axis, loop in loops.items()}
    return table


def _borne(loop: FeedbackLoop) -> dict[str, Any]:
    """Part of an axis's document that compares it with the rule."""
    found = robustness(loop)
    peaks = found.peak_sensitivity, max(found.corner_sensitivities), found.corner_limit
    around, at_corners, limit = (peak if math.isfinite(peak) else None for peak in peaks)
    return {
        "peak_sensitivity": around,
        "corner_sensitivity": at_corners,
        "below_rule": list(found.shortfalls),
        "rule": loop.rule._asdict() | {"corner_sensitivity": limit},
    }


def rows_of(name: str, found: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    """Rows of the table of a vehicle's margins, in `COLUMNS`: its axes, each with its rule."""
    if found["axes"] is None:
        yield name, found["unknown"]
        return
    for axis, margin in found["axes"].items():
        yield (
            name,
            axis,
            _at_most(margin["gain_up"], GAIN_LIMIT, 2),
            _at_least(margin["gain_down"], 1.0 / GAIN_LIMIT),
            _at_most(math.degrees(margin["phase_rad"]), math.degrees(PHASE_LIMIT_RAD), 0),
            _at_most(1000 * margin["delay_s"], 1000 * DELAY_LIMIT_S, 0),
            _at_most(margin["frequency_up"], FREQUENCY_LIMIT, 2),
            _at_least(margin["frequency_down"], 1.0 / FREQUENCY_LIMIT),
            _peak(margin["peak_sensitivity"]),
            _peak(margin["corner_sensitivity"]),
            ", ".join(margin["below_rule"]) or "-",
        )
        rule = margin["rule"]
        gain, frequency = rule["gain_factor"], rule["frequency_fraction"]
        yield (
            name, "its rule", f"{gain:.2f}", f"{1 / gain:.2f}", "", f"{1000 * rule['delay_s']:.0f}",
            f"{1 + frequency:.2f}", f"{1 - frequency:.2f}", f"{SENSITIVITY_LIMIT:.2f}",
            "stable" if rule["corner_sensitivity"] is None else f"{rule['corner_sensitivity']:.2f}", "",
        )  # fmt: skip


def _peak(sensitivity: float | None) -> str:
    return "-" if sensitivity is None else f"{sensitivity:.2f}"


def _at_most(value: float, limit: float, digits: int) -> str:
    return f"{value:.{digits}f}" if value < _NEARLY * limit else f">{limit:.{digits}f}"


def _at_least(value: float, limit: float) -> str:
    return f"{value:.2f}" if value * _NEARLY > limit else "any"


def flying_warnings(fleet: Fleet) -> list[str]:
    """A line for every axis below the rule, as a running fleet is tuned and identified now."""
    return [
        line
        for vehicle in fleet
        if (agent := vehicle.state.agent) is not None
        for line in _warnings(fleet.file, vehicle.name, Configuration.reported(agent.diagnostics))
    ]


def _warnings(file: FleetFile, name: str, used: Configuration) -> list[str]:
    if unknown_loops(used) is not None:
        return []
    return [
        f"{name}: margins of {axis} below the rule: {', '.join(names)}; raise its input weight, "
        "or identify the vehicle"
        for axis, loop in _loops(file, name, used).items()
        if (names := robustness(loop).shortfalls)
    ]


def _loops(file: FleetFile, name: str, used: Configuration) -> dict[str, FeedbackLoop]:
    """Return the loops of a vehicle by axis, with a controller and an estimator whose loops are known."""
    model, period_s = used.flown_model(model_of(file, name)), file.vehicles[name].control.period_s
    return loops_of(model, period_s, used.controller_settings, used.estimator_settings)


def unknown_loops(configuration: Configuration) -> str | None:
    """Return why the loops of a configuration are not known; None for the default pair, whose loops are."""
    if (configuration.controller, configuration.estimator) == (DEFAULT_CONTROLLER, DEFAULT_ESTIMATOR):
        return None
    flown = f"{configuration.controller} with {configuration.estimator}"
    return f"margins are known for {DEFAULT_CONTROLLER} with {DEFAULT_ESTIMATOR}, not for {flown}"
