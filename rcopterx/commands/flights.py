"""Flight logs: `flights` and `recover`."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import EXIT_FAILED, failure
from rcopterx.commands.output import JsonOption, print_document, print_table

MEGA = 1e6


def flights(
    as_json: JsonOption = False,
    check: Annotated[
        str | None,
        typer.Option(metavar="FLIGHT", help="Check what always holds in a flight; else exit code 1."),
    ] = None,
    digest: Annotated[
        str | None,
        typer.Option(
            metavar="FLIGHT", help="Print a digest; flights in lockstep that are alike have the same."
        ),
    ] = None,
) -> None:
    """List recorded flights, the newest last."""
    from rcopterx.flights.flights import default_directory, flights_in
    from rcopterx.flights.listing import summary_of

    where = default_directory()
    if check is not None:
        _check(check, where)
        return
    if digest is not None:
        _print_digest(digest, where)
        return
    found = [summary_of(flight) for flight in flights_in(where)]
    if as_json:
        print_document([asdict(flight) for flight in found], as_json)
    elif not found:
        typer.echo(f"no flights in {where}", err=True)
    else:
        typer.echo(where)
        print_table(
            ("flight", "vehicles", "size [MB]", "files", "state"),
            (
                (
                    flight.name,
                    " ".join(flight.vehicles),
                    f"{flight.size_bytes / MEGA:.1f}",
                    str(flight.files),
                    flight.problem or ("complete" if flight.complete else "open or cut off"),
                )
                for flight in found
            ),
        )


def _print_digest(name: str, directory: Path) -> None:
    from rcopterx.flights.digest import digest_of
    from rcopterx.flights.flights import NoFlightError, found_flight
    from rcopterx.flights.mcap_reading import FlightLogError

    try:
        found = digest_of(found_flight(name, directory).parts)
    except (NoFlightError, FlightLogError) as error:
        raise failure(error) from None
    typer.echo(f"{found.digest} of {found.messages} messages")


def _check(name: str, directory: Path) -> None:
    from rcopterx.flights.flights import NoFlightError, found_flight
    from rcopterx.flights.mcap_reading import FlightLogError
    from rcopterx.ground_station.report.logged_flight import records_of
    from rcopterx.ground_station.report.promises import NEEDED, broken_promises
    from rcopterx.ground_station.report.recorder import Recording

    try:
        flight = found_flight(name, directory)
        broken = broken_promises(Recording(records_of(flight.parts, NEEDED)))
    except (NoFlightError, FlightLogError) as error:
        raise failure(error) from None
    lines = [f"{at_s:.2f} s {vehicle}: {promise}" for at_s, vehicle, promise in broken]
    typer.echo("\n".join(lines) or f"{flight.name}: no promise is broken")
    if broken:
        raise typer.Exit(EXIT_FAILED)


def recover(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of a flight log that was cut off.")],
) -> None:
    """Repair a flight log that was cut off when its recorder was killed, in place."""
    from rcopterx.flights.listing import mend
    from rcopterx.flights.mcap_reading import FlightLogError, contents_of
    from rcopterx.flights.recorder import schemas

    try:
        if contents_of(file).complete:
            typer.echo(f"{file}: complete, nothing to repair")
            return
        mended = mend(file, schemas())
    except (FlightLogError, OSError) as error:
        raise failure(error) from None
    damaged = f", {mended.damaged_chunks} damaged chunks left out" if mended.damaged_chunks else ""
    typer.echo(f"{file}: {mended.messages} messages{damaged}")
