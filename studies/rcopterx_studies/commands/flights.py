"""What flight logs show: `replay --agent`, `replay --transmitter`, `flights --check`, `flights --digest`."""

from collections.abc import Sequence
from dataclasses import asdict
from itertools import chain
from typing import TYPE_CHECKING, Any

import typer

from rcopterx.commands.fleet_option import EXIT_FAILED
from rcopterx.commands.output import print_document

if TYPE_CHECKING:
    from rcopterx.flights.flights import Flight
    from rcopterx_studies.replay.agent_replay import Comparison, Difference
    from rcopterx_studies.replay.arbiter_replay import ArbiterComparison


def check(flight: "Flight", missing: Sequence[str]) -> None:
    """Print what a flight breaks of what always holds; exit code 1 for that, and if its log is incomplete."""
    from rcopterx.ground_station.report.logged_flight import records_of
    from rcopterx.ground_station.report.recorder import Recording
    from rcopterx_studies.faults.flight_promises import NEEDED, broken_promises

    broken = broken_promises(Recording(records_of(flight.parts, NEEDED)))
    lines = [f"{at_s:.2f} s {vehicle}: {promise}" for at_s, vehicle, promise in broken]
    where = " in what was recorded" if missing else ""
    typer.echo("\n".join(lines) or f"{flight.name}: no promise is broken{where}")
    if broken or missing:
        raise typer.Exit(EXIT_FAILED)


def print_digest(flight: "Flight") -> None:
    """Print the digest of a flight."""
    from rcopterx.flights.mcap_reading import messages_of
    from rcopterx_studies.replay.digest import digest_of

    found = digest_of(chain.from_iterable(map(messages_of, flight.parts)))
    typer.echo(f"{found.digest} of {found.messages} messages")


def compare(flight: "Flight", vehicle: str, changes: dict[str, Any], as_json: bool) -> None:
    """Run the agent of a vehicle on its recorded inputs, perhaps changed, and print how the two differ."""
    from rcopterx.flights.provenance import provenance
    from rcopterx_studies.replay.agent_replay import TOLERANCE, arithmetic, changed, replay
    from rcopterx_studies.replay.recorded_agent import recorded_agent

    recorded = recorded_agent(flight.parts, vehicle)
    same = arithmetic(recorded.metadata) == arithmetic(provenance())
    fleet = changed(recorded.fleet, vehicle, changes) if changes else recorded.fleet
    result = replay(recorded, fleet, 0.0 if same else TOLERANCE)
    print_document(asdict(result), as_json, lambda _: "\n".join(_lines(result, _rule(same, changes))))
    if not changes and (result.first is not None or not result.periods):
        raise typer.Exit(EXIT_FAILED)


def compare_arbiter(flight: "Flight", vehicle: str, as_json: bool) -> None:
    """Make the recorded calls of the arbiter of a vehicle again, and print how its frames differ."""
    from rcopterx.flights.mcap_reading import messages_of
    from rcopterx.ground_station.republishing import fleet_of
    from rcopterx_studies.replay.arbiter_replay import RecordedArbiters, replay_arbiter

    messages = chain.from_iterable(map(messages_of, flight.parts))
    recorded = RecordedArbiters(vehicle, fleet_of(flight.parts), messages)
    result = replay_arbiter(recorded, recorded.fleet)
    print_document(asdict(result), as_json, lambda _: "\n".join(_arbiter_lines(result)))
    if result.first is not None or not result.frames:
        raise typer.Exit(EXIT_FAILED)


def _arbiter_lines(result: "ArbiterComparison") -> list[str]:
    return [
        f"{result.vehicle}: {result.frames} frames in {result.flown_s:.1f} s, "
        f"{result.identical} the same to the last bit",
        f"  inputs missing {result.missing_inputs}, frames unmatched {result.unmatched}",
        *_remarks(result.notes, result.first),
    ]


def _remarks(notes: Sequence[str], first: "Difference | None") -> list[str]:
    lines = [f"  note: {note}" for note in notes]
    if first is not None:
        lines.append(
            f"  first difference after {first.time_s:.3f} s, frame {first.frame}: "
            f"{first.cause}: {first.detail}"
        )
    return lines


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
    return lines + _remarks(result.notes, result.first)
