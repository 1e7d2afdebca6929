"""How far vehicles may be from their models: `margins`."""

import json
import math
from collections.abc import Iterator
from typing import Annotated, Any

import typer

from rcopterx.commands.steer import Vehicles, known_vehicles
from rcopterx.fleet_option import EXIT_FAILED, FleetArgument, fleet_file, user_errors

COLUMNS = (
    "vehicle", "axis", "gain up", "gain down", "phase [deg]", "delay [ms]", "frequency up", "frequency down",
    "below the rule",
)  # fmt: skip
_NEARLY = 0.999


def margins(
    fleet: FleetArgument,
    vehicles: Vehicles = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON document.")] = False,
) -> None:
    """Tell gain, phase and delay margins of vehicles as a fleet file configures them.

    Exit code 0 if all are as large as the model's uncertainty asks for, 1 otherwise.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from rcopterx.ground_station.margins import fleet_margins

    with user_errors():
        file = fleet_file(fleet)
        known_vehicles(file.vehicles, vehicles)
        document = fleet_margins(file, vehicles or file.vehicles)
    if as_json:
        typer.echo(json.dumps(document, indent=2))
    else:
        table = Table(box=None, pad_edge=False)
        for heading in COLUMNS:
            # Headings of two lines leave room for every column on a terminal of 80 columns.
            table.add_column(Text(heading.replace(" ", "\n", 1)), no_wrap=True)
        for name, found in document["vehicles"].items():
            for row in _rows(name, found):
                table.add_row(*map(Text, row))
        Console().print(table, highlight=False)
    axes = [axis for found in document["vehicles"].values() for axis in (found["axes"] or {}).values()]
    if any(axis["below_rule"] for axis in axes):
        raise typer.Exit(EXIT_FAILED)


def _rows(name: str, found: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    """Rows of a vehicle: its axes, and what the rule asks for."""
    from rcopterx.agents.margins.search import DELAY_LIMIT_S, FREQUENCY_LIMIT, GAIN_LIMIT, PHASE_LIMIT_RAD

    if found["axes"] is None:
        yield name, found["unknown"]
        return
    for axis, margin in found["axes"].items():
        yield (
            name,
            axis,
            _at_most(margin["gain_up"], GAIN_LIMIT, 2),
            f"{margin['gain_down']:.2f}" if margin["gain_down"] * GAIN_LIMIT > 1.0 / _NEARLY else "any",
            _at_most(math.degrees(margin["phase_rad"]), math.degrees(PHASE_LIMIT_RAD), 0),
            _at_most(1000 * margin["delay_s"], 1000 * DELAY_LIMIT_S, 0),
            _at_most(margin["frequency_up"], FREQUENCY_LIMIT, 2),
            f"{margin['frequency_down']:.2f}"
            if margin["frequency_down"] * FREQUENCY_LIMIT > 1.0 / _NEARLY
            else "any",
            ", ".join(margin["below_rule"]) or "-",
        )
    rule = found["rule"]
    yield (
        name,
        "rule",
        f"{rule['gain_factor']:.2f}",
        f"{1 / rule['gain_factor']:.2f}",
        "",
        f"{1000 * rule['delay_s']:.0f}",
        f"{1 + rule['frequency_fraction']:.2f}",
        f"{1 - rule['frequency_fraction']:.2f}",
        "",
    )


def _at_most(value: float, limit: float, digits: int) -> str:
    return f"{value:.{digits}f}" if value < _NEARLY * limit else f"> {limit:.{digits}f}"
