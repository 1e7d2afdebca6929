"""Flight logs for other programs: `export`."""

from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import EXIT_FAILED
from rcopterx.commands.replay import FlightArgument, chosen_flight


def export(
    flight: FlightArgument = "latest",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Where to. Default: the flight's name."),
    ] = None,
) -> None:
    """Write a flight log as CSV tables: a file for every unit and channel, a row for every message."""
    from rcopterx.flight_log.csv_export import export_csv
    from rcopterx.flight_log.mcap_reading import FlightLogError

    found = chosen_flight(flight)
    directory = output or Path(found.name)
    try:
        tables = export_csv(found.parts, directory)
    except (FlightLogError, OSError) as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(EXIT_FAILED) from None
    typer.echo(f"{len(tables)} tables in {directory}")
