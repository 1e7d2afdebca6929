"""Reports of recorded flights: `report`."""

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final

import typer

from rcopterx.commands.fleet_option import failure, user_errors
from rcopterx.commands.replay import FlightArgument, chosen_flight

INSTALL: Final = "pip install 'rcopterx[figures]'"


def report(
    flight: FlightArgument = "latest",
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="File to write.")] = Path(
        "report.html"
    ),
    compare: Annotated[
        str | None, typer.Option("--compare", metavar="FLIGHT", help="Show this flight beside the first one.")
    ] = None,
) -> None:
    """Write a self-contained page about a flight: playback, errors, latencies, events, provenance."""
    if find_spec("matplotlib") is None:
        raise failure(f"a report needs matplotlib: {INSTALL}")
    from rcopterx.flights.mcap_reading import FlightLogError
    from rcopterx.ground_station.report.logged_flight import logged_flight
    from rcopterx.ground_station.report.page import comparison_page, report_page

    with user_errors():
        chosen = [chosen_flight(name) for name in (flight, compare) if name is not None]
    try:
        flights = [logged_flight(found.name, found.parts) for found in chosen]
        page = report_page(flights[0]) if compare is None else comparison_page(*flights)
        output.write_text(page, encoding="utf-8")
    except (FlightLogError, OSError) as error:
        raise failure(error) from None
    typer.echo(f"report: {output}")
