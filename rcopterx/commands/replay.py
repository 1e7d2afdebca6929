"""Replaying a flight log: `replay`."""

import os
import signal
import threading
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rcopterx.bus.realtime import ONE_THREAD
from rcopterx.commands.fleet_option import EXIT_FAILED, failure, user_errors
from rcopterx.commands.output import JsonOption, print_document
from rcopterx.commands.parsing import settings_of

if TYPE_CHECKING:
    from rcopterx.flights.flights import Flight
    from rcopterx.ground_station.replay.agent_replay import Comparison

FlightArgument = Annotated[
    str, typer.Argument(metavar="FLIGHT", help="A file, or the name of a flight, see rcopterx flights.")
]


def replay(
    flight: FlightArgument = "latest",
    agent: Annotated[
        str | None,
        typer.Option(
            metavar="VEHICLE", help="Run the agent of this vehicle on its recorded inputs, and compare."
        ),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="NAME=VALUE",
            help="Change controller, estimator, horizon or a setting. Repeatable.",
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option(metavar="FACTOR", min=0.01, help="Speed relative to the flight.")
    ] = 1.0,
    as_json: JsonOption = False,
) -> None:
    """Publish a flight log for status, top and ground, or run an agent on its recorded inputs.

    Exit code 1 if the agent does not repeat the flight.
    """
    # Sums of several threads have other last bits; numerical libraries read this when they are loaded.
    os.environ.update(ONE_THREAD)
    with user_errors():
        found = chosen_flight(flight)
        if agent is None:
            _republish(found, speed)
            return
        _compare(found, agent, settings_of(changes or (), "--with"), as_json)


def chosen_flight(name: str) -> "Flight":
    """Flight of a name; the error lists the known flights."""
    from rcopterx.flights.flights import NoFlightError, default_directory, found_flight

    try:
        return found_flight(name, default_directory())
    except NoFlightError as error:
        raise typer.BadParameter(str(error), param_hint="FLIGHT") from None


def _republish(flight: "Flight", speed: float) -> None:
    from rcopterx.bus.session import Session
    from rcopterx.ground_station.replay.republishing import ROUTER_S, fleet_of, republish, router_up

    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    with router_up(fleet_of(flight.parts)) as address, Session(address, timeout_s=ROUTER_S) as session:
        typer.echo(f"replaying {flight.name}; rcopterx top and ground show it; Ctrl-C ends it", err=True)
        typer.echo(f"{republish(flight.parts, session, speed, stop.wait)} messages")


def _compare(flight: "Flight", vehicle: str, changes: dict[str, Any], as_json: bool) -> None:
    from rcopterx.flights.mcap_reading import FlightLogError
    from rcopterx.flights.provenance import arithmetic, provenance
    from rcopterx.ground_station.replay.agent_replay import TOLERANCE, changed, replay
    from rcopterx.ground_station.replay.recorded_agent import recorded_agent

    try:
        recorded = recorded_agent(flight.parts, vehicle)
    except FlightLogError as error:
        raise failure(error) from None
    same = arithmetic(recorded.metadata) == arithmetic(provenance())
    fleet = changed(recorded.fleet, vehicle, changes) if changes else recorded.fleet
    result = replay(recorded, fleet, 0.0 if same else TOLERANCE)
    print_document(asdict(result), as_json, lambda _: "\n".join(_lines(result, _rule(same, changes))))
    if not changes and (result.first is not None or not result.periods):
        raise typer.Exit(EXIT_FAILED)


def _rule(same: bool, changes: dict[str, Any]) -> str:
    if changes:
        return "flown with " + ", ".join(f"{name}={value}" for name, value in changes.items())
    return "must be the same to the last bit" if same else "another computer: small differences are allowed"


def _lines(result: "Comparison", rule: str) -> list[str]:
    rms = ", ".join(f"{value:.3g}" for value in result.rms_input)
    lines = [
        f"{result.vehicle}: {result.periods} control periods in {result.flown_s:.1f} s, "
        f"{result.identical} the same to the last bit ({rule})",
        f"  sticks (pitch, roll, thrust, yaw): rms {rms}; largest {result.largest_input:.3g}",
        f"  plans: largest {result.largest_plan:.3g} m or m/s",
    ]
    lines += [f"  note: {note}" for note in result.notes]
    if result.first is not None:
        first = result.first
        lines.append(
            f"  first difference after {first.time_s:.3f} s, frame {first.frame}: "
            f"{first.cause}: {first.detail}"
        )
    return lines
