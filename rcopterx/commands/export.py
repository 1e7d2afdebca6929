"""Flight logs for other programs: `export`."""

from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import failure
from rcopterx.commands.replay import FlightArgument, chosen_flight


class Format(StrEnum):
    """Formats of exported flight logs."""

    CSV = "csv"
    FOXGLOVE = "foxglove"


def export(
    flight: FlightArgument = "latest",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Directory to write. Default: the flight's name."),
    ] = None,
    to: Annotated[
        Format,
        typer.Option("--to", help="Tables as CSV, or a file and a layout in Foxglove's standard schemas."),
    ] = Format.CSV,
) -> None:
    """Export a flight log for other programs.

    CSV has a file for every unit and channel, with a row for every message.
    """
    from rcopterx.flights.mcap_reading import FlightLogError

    if to is Format.FOXGLOVE and find_spec("foxglove") is None:
        raise failure("foxglove needs its SDK: pip install 'rcopterx[foxglove]'")
    found = chosen_flight(flight)
    directory = output or Path(found.name)
    try:
        if to is Format.CSV:
            from rcopterx.flights.csv_export import export_csv

            typer.echo(f"{len(export_csv(found.parts, directory))} tables in {directory}")
        else:
            from rcopterx.ground_station.foxglove.export import export_foxglove

            typer.echo(f"{len(export_foxglove(found.parts, directory))} files in {directory}")
    except (FlightLogError, OSError) as error:
        raise failure(error) from None
