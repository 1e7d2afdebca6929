"""Stability margins of vehicles: `margins`."""

import typer

from rcopterx.commands.fleet_option import EXIT_FAILED, FleetArgument, fleet_file, known_vehicles, user_errors
from rcopterx.commands.output import JsonOption, print_document, print_table
from rcopterx.commands.steer import Vehicles


def margins(
    fleet: FleetArgument,
    vehicles: Vehicles = None,
    as_json: JsonOption = False,
) -> None:
    """Show gain, phase and delay margins of vehicles as a fleet file configures them.

    Exit code 1 if a margin is smaller than the uncertainty of the model requires.
    """
    from rcopterx.ground_station.terminal.margins import COLUMNS, fleet_margins, rows_of

    with user_errors():
        file = fleet_file(fleet)
        known_vehicles(file.vehicles, vehicles)
        document = fleet_margins(file, vehicles or file.vehicles)
    if as_json:
        print_document(document, as_json)
    else:
        # With headings of two lines all columns fit into 80 characters.
        headings = [heading.replace(" ", "\n", 1) for heading in COLUMNS]
        rows = (row for name, found in document["vehicles"].items() for row in rows_of(name, found))
        print_table(headings, rows)
    axes = [axis for found in document["vehicles"].values() for axis in (found["axes"] or {}).values()]
    if any(axis["below_rule"] for axis in axes):
        raise typer.Exit(EXIT_FAILED)
