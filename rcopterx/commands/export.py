"""Flight logs for other programs: `export`."""

from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import failure
from rcopterx.commands.replay import FlightArgument, chosen_flight


def export(
    flight: FlightArgument = "latest",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Directory. Default: the flight's name."),
    ] = None,
) -> None:
    """Export a flight log as CSV: a file for every unit and channel, with a row for every message."""
    from rcopterx.flights.csv_export import export_csv
    from rcopterx.flights.mcap_reading import FlightLogError

    found = chosen_flight(flight)
    directory = output or Path(found.name)
    try:
        typer.echo(f"{len(export_csv(found.parts, directory))} tables in {directory}")
    except (FlightLogError, OSError) as error:
        raise failure(error) from None
