"""Flight logs for other programs: `export`."""

from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final

import typer

from rcopterx.commands.fleet_option import failure
from rcopterx.commands.replay import FlightArgument, chosen_flight


class Format(StrEnum):
    """Formats of exported flight logs."""

    CSV = "csv"
    PARQUET = "parquet"
    FOXGLOVE = "foxglove"


LIBRARIES: Final = {Format.PARQUET: "pyarrow", Format.FOXGLOVE: "foxglove"}
"""Library that a format needs; the extra of rcopterx has the name of the format."""


def export(
    flight: FlightArgument = "latest",
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Directory to write. Default: the flight's name."),
    ] = None,
    to: Annotated[
        Format,
        typer.Option(
            "--to", help="Tables as CSV or Parquet, or a file and a layout in Foxglove's standard schemas."
        ),
    ] = Format.CSV,
) -> None:
    """Export a flight log for other programs.

    CSV and Parquet have a file for every unit and channel, with a row for every message.
    """
    from rcopterx.flights.mcap_reading import FlightLogError

    library = LIBRARIES.get(to)
    if library is not None and find_spec(library) is None:
        raise failure(f"{to} needs {library}: pip install 'rcopterx[{to}]'")
    found = chosen_flight(flight)
    directory = output or Path(found.name)
    try:
        files = _write(to, found.parts, directory)
    except (FlightLogError, OSError) as error:
        raise failure(error) from None
    typer.echo(f"{len(files)} {'files' if to is Format.FOXGLOVE else 'tables'} in {directory}")


def _write(to: Format, parts: tuple[Path, ...], directory: Path) -> list[Path]:
    match to:
        case Format.CSV:
            from rcopterx.flights.csv_export import export_csv

            return export_csv(parts, directory)
        case Format.PARQUET:
            from rcopterx.flights.parquet_export import export_parquet

            return export_parquet(parts, directory)
        case Format.FOXGLOVE:
            from rcopterx.ground_station.foxglove.export import export_foxglove

            return export_foxglove(parts, directory)
