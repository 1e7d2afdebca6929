"""Checks on a recorded flight: a name, a figure, and whether it is acceptable."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ground_station.report import FlightFigures, percentiles

Result = tuple[bool, Any]


@dataclass(frozen=True)
class Check:
    """One line of a report: `judge` gets the figures and the table of each vehicle."""

    name: str
    judge: Callable[[FlightFigures, dict[str, dict[str, Any]]], Result]

    def run(self, figures: FlightFigures, vehicles: dict[str, dict[str, Any]]) -> dict[str, Any]:
        """Table of the report: `name`, `passed`, `figure`."""
        passed, figure = self.judge(figures, vehicles)
        return {"name": self.name, "passed": bool(passed), "figure": figure}


def always() -> tuple[Check, ...]:
    """Checks every manoeuvre has to pass."""
    return (
        Check("every vehicle ticked", lambda _, v: _least(v, "ticks", at_least=1)),
        Check("no control period was missed", lambda _, v: _sum_is_zero(v, "missed_ticks")),
        Check("no vehicle touched the floor", _touched_floor),
        Check("no vehicle left the flight volume", _left_volume),
    )


def latency_checks(command_ms: float = 5.0, radio_ms: float = 12.0) -> tuple[Check, ...]:
    """Latency limits on the 99th percentiles [ms]."""
    return (
        Check(
            f"pose to command, p99 at most {command_ms:g} ms",
            lambda figures, _: _p99(figures.pose_to_command_ms(), command_ms),
        ),
        Check(
            f"frame to radio, p99 at most {radio_ms:g} ms",
            lambda figures, _: _p99(figures.frame_to_radio_ms(), radio_ms),
        ),
    )


def _p99(values: list[float], limit_ms: float) -> Result:
    figures = percentiles(values)
    return (figures is not None and figures["p99"] <= limit_ms), figures and figures["p99"]


def _least(vehicles: dict[str, dict[str, Any]], field: str, at_least: int) -> Result:
    least = min(table[field] for table in vehicles.values())
    return least >= at_least, least


def _sum_is_zero(vehicles: dict[str, dict[str, Any]], field: str) -> Result:
    total = sum(table[field] for table in vehicles.values())
    return total == 0, total


def _touched_floor(figures: FlightFigures, vehicles: dict[str, dict[str, Any]]) -> Result:
    touched = [name for name in vehicles if any(truth.on_floor for truth in figures.truth(name))]
    return not touched, touched


def _left_volume(figures: FlightFigures, vehicles: dict[str, dict[str, Any]]) -> Result:
    outside = [name for name in vehicles if any(truth.outside for truth in figures.truth(name))]
    return not outside, outside
