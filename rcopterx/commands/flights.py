"""Flight logs: `flights`, `replay`, `report`, `export` and `recover`."""

import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import typer

from rcopterx.bus.realtime import ONE_THREAD
from rcopterx.commands.extensions import added
from rcopterx.commands.fleet_option import EXIT_FAILED
from rcopterx.commands.interruption import counted_interrupts
from rcopterx.commands.output import JsonOption, print_document, print_table
from rcopterx.commands.parsing import settings_of

if TYPE_CHECKING:
    from rcopterx.flights.flights import Flight

MEGA: Final = 1e6


def flights(as_json: JsonOption = False, check: str | None = None, digest: str | None = None) -> None:
    """List recorded flights, the newest last."""
    if check is not None and digest is not None:
        raise typer.BadParameter("give one of them", param_hint="--check, --digest")
    if check is not None:
        study, chosen = added("flights", "flights --check"), _flight(check)
        study.check(chosen, _warned(chosen))
        return
    if digest is not None:
        study, chosen = added("flights", "flights --digest"), _flight(digest)
        _warned(chosen)
        study.print_digest(chosen)
        return
    from rcopterx.flights.flights import default_directory, flights_in
    from rcopterx.flights.listing import summary_of

    where = default_directory()
    found = [summary_of(flight) for flight in flights_in(where)]
    if as_json:
        print_document([asdict(flight) for flight in found], as_json)
    elif not found:
        typer.echo(f"no flights in {where}", err=True)
    else:
        typer.echo(where)
        rows = (
            (
                one.name,
                " ".join(one.vehicles),
                f"{one.size_bytes / MEGA:.1f}",
                str(one.files),
                one.problem or one.state,
            )
            for one in found
        )
        print_table(("flight", "vehicles", "size [MB]", "files", "state"), rows)


def _flight(name: str) -> "Flight":
    from rcopterx.flights.flights import default_directory, found_flight

    return found_flight(name, default_directory())


def _warned(flight: "Flight") -> list[str]:
    """Print what a flight log lacks as warnings, and return it."""
    from rcopterx.flights.listing import incomplete

    lines = incomplete(flight)
    for line in lines:
        typer.echo(f"warning: {flight.name} is incomplete: {line}", err=True)
    return lines


def recover(file: Path) -> None:
    """Write a complete file beside a damaged one or one that was cut off.

    Exit code 1 if something is missing.
    """
    from rcopterx.flights.listing import mend
    from rcopterx.flights.mcap_reading import contents_of

    if contents_of(file).complete:
        typer.echo(f"{file}: complete, nothing to repair")
        return
    mended = mend(file)
    typer.echo(f"{mended.path}: {mended.messages} messages")
    for line in mended.missing:
        typer.echo(f"missing: {line}", err=True)
    if mended.missing:
        raise typer.Exit(EXIT_FAILED)


def replay(
    flight: str = "latest",
    agent: str | None = None,
    transmitter: str | None = None,
    changes: list[str] | None = None,
    speed: float = 1.0,
    as_json: JsonOption = False,
) -> None:
    """Publish a flight log for status, top and ground, or run an agent or arbiter on its recorded inputs.

    Exit code 1 if it does not repeat the flight.
    """
    if agent is not None and transmitter is not None:
        raise typer.BadParameter("give one of them", param_hint="--agent, --transmitter")
    if changes and agent is None:
        raise typer.BadParameter("needs --agent", param_hint="--with")
    # Sums of several threads have other last bits; numerical libraries read this when they are loaded.
    os.environ.update(ONE_THREAD)
    option = "--agent" if agent is not None else "--transmitter" if transmitter is not None else ""
    study: Any = added("flights", f"replay {option}") if option else None
    found = _flight(flight)
    _warned(found)
    if transmitter is not None:
        study.compare_arbiter(found, transmitter, as_json)
    elif agent is not None:
        study.compare(found, agent, settings_of(changes or (), "--with"), as_json)
    else:
        _republish(found, speed)


def _republish(flight: "Flight", speed: float) -> None:
    from rcopterx.bus.session import Session
    from rcopterx.ground_station.republishing import ROUTER_S, fleet_of, republish, router_up

    interrupts = counted_interrupts()
    with router_up(fleet_of(flight.parts)) as address, Session(address, timeout_s=ROUTER_S) as session:
        typer.echo(f"replaying {flight.name}; rcopterx top and ground show it; Ctrl-C ends it", err=True)
        typer.echo(f"{republish(flight.parts, session, speed, interrupts.wait)} messages")


def report(flight: str = "latest", output: Path = Path("report.html"), compare: str | None = None) -> None:
    """Save the page of a flight as one file that plays it: figures, plots, events, provenance."""
    from rcopterx.ground_station.report.logged_flight import logged_flight
    from rcopterx.ground_station.report.page import report_page

    chosen = [_flight(name) for name in (flight, compare) if name is not None]
    flights = [logged_flight(found.name, found.parts, _warned(found)) for found in chosen]
    output.write_text(report_page(*flights), encoding="utf-8")
    typer.echo(f"report: {output}")


def export(flight: str = "latest", output: Path | None = None) -> None:
    """Export a flight log as CSV: a file for every unit and channel, with a row for every message."""
    from rcopterx.flights.csv_export import export_csv

    found = _flight(flight)
    _warned(found)
    directory = output or Path(found.name)
    typer.echo(f"{len(export_csv(found.parts, directory))} tables in {directory}")
