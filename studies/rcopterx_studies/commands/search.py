"""Searching for flights that break a promise: `search`."""

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from msgspec import MsgspecError
from typer import Argument, Option

from rcopterx.commands.fleet_option import EXIT_FAILED
from rcopterx.commands.output import JsonOption, Progress, print_document

if TYPE_CHECKING:
    from rcopterx_studies.search.flights import Flight
    from rcopterx_studies.search.flying import Flown

app = typer.Typer(add_completion=False)
FOUND = Path("found")


def _numbers(text: str) -> tuple[int, ...]:
    """Numbers of vehicles as in `2..6` or `3`."""
    from rcopterx_studies.search.flights import MOST

    first, _, last = text.partition("..")
    try:
        numbers = tuple(range(int(first), int(last or first) + 1))
    except ValueError:
        numbers = ()
    if not numbers or not set(numbers) <= set(range(1, MOST + 1)):
        raise typer.BadParameter(f"{text!r}: allowed is N or N..M, 1 to {MOST} vehicles")
    return numbers


@dataclass
class _Search:
    """What was flown, and what was found."""

    directory: Path
    found: list[dict[str, Any]] = field(default_factory=list)
    flights: int = 0
    flown_s: float = 0.0

    def add(self, flight: "Flight", flown: "Flown", say: Progress) -> None:
        """Note a flight; shrink one that breaks a promise, and write it to a file."""
        from rcopterx_studies.search.flying import fly
        from rcopterx_studies.search.shrinking import shrunk

        self.flights += 1
        self.flown_s += flown.flown_s
        if not flown.findings:
            return
        promise, _, text = flown.findings[0]
        say.say(f"{promise}: {text}")

        def breaks(smaller: "Flight") -> bool:
            say.show(f"shrinking: {len(smaller.happenings)} happenings")
            return any(found.promise == promise for found in fly(smaller).findings)

        small = shrunk(flight, breaks)
        self.directory.mkdir(parents=True, exist_ok=True)
        path = self.directory / f"{promise}-{flight.seed}.json"
        small.save(path)
        row = {"seed": flight.seed, "promise": promise, "text": text, "file": str(path)}
        self.found.append(row | {"happenings": len(small.happenings)})


@app.command(rich_help_panel="Try out faults")
def search(
    files: Annotated[
        list[Path] | None, Argument(metavar="FILE", exists=True, help="Fly these flights again.")
    ] = None,
    hours: Annotated[float, Option(metavar="H", min=0, help="For how long to search.")] = 1.0,
    seed: Annotated[int, Option(metavar="N", min=0, help="Seed of the first flight.")] = 0,
    vehicles: Annotated[str, Option(metavar="N..M", help="Number of vehicles.")] = "1..3",
    types: Annotated[
        str, Option(metavar="TYPE,TYPE,...", help="Types of the vehicles, with radios at serial ports.")
    ] = "coaxial,betaflight",
    directory: Annotated[Path, Option(metavar="DIRECTORY", help="For flights that break a promise.")] = FOUND,
    as_json: JsonOption = False,
) -> None:
    """Fly random fleets in one process until one breaks a promise, and shrink its flight.

    Exit code 1 if a promise was broken.
    """
    import logging

    from rcopterx_studies.search.flights import read_flight
    from rcopterx_studies.search.flying import fly
    from rcopterx_studies.search.guiding import Guide

    logging.disable(logging.CRITICAL)
    if files:
        broken = False
        for path in files:
            try:
                flight = read_flight(path)
            except (OSError, MsgspecError) as error:
                raise typer.BadParameter(f"{path}: no searched flight: {error}") from None
            flown = fly(flight)
            broken = broken or bool(flown.findings)
            lines = [f"{found.promise} at {found.at_s:.3f} s: {found.text}" for found in flown.findings]
            typer.echo(f"{path}: {'; '.join(lines) or 'all promises hold'} (digest {flown.digest})")
        raise typer.Exit(EXIT_FAILED if broken else 0)
    guide = Guide(_numbers(vehicles), tuple(types.split(",")))
    ends_s, result = time.monotonic() + 3600.0 * hours, _Search(directory)
    while time.monotonic() < ends_s or not result.flights:
        flight = guide.draw(seed + result.flights)
        say = Progress(f"seed {flight.seed}")
        flown = fly(flight)
        say.say(f"{len(flight.types)} vehicles, {len(flight.happenings)} happenings, {flown.flown_s:.0f} s")
        guide.note(flight, flown.visited)
        result.add(flight, flown, say)
    flown_s, visited = round(result.flown_s), dict(sorted(guide.visited.items()))
    document = {"flights": result.flights, "flown_s": flown_s, "found": result.found, "visited": visited}
    print_document(document, as_json, _text)
    if result.found:
        raise typer.Exit(EXIT_FAILED)


def _text(document: dict[str, Any]) -> str:
    lines = [
        f"{one['promise']:12} seed {one['seed']}: {one['text']}; rcopterx search {one['file']}"
        for one in document["found"]
    ]
    visited = f"{len(document['visited'])} states and transitions"
    return "\n".join([*lines, f"{document['flights']} flights of {document['flown_s']} s, {visited}"])
