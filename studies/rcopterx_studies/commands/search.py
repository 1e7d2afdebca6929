"""Searching for flights that break a promise: `search`."""

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from typer import Argument, Option

from rcopterx.commands.fleet_option import EXIT_FAILED
from rcopterx.commands.output import JsonOption, Progress, print_document

if TYPE_CHECKING:
    from rcopterx_studies.search.flights import Flight
    from rcopterx_studies.search.flying import Flown

app = typer.Typer(add_completion=False)
MOST_VEHICLES: Final = 6


def _numbers(text: str) -> tuple[int, ...]:
    """Numbers of vehicles as in `2..6` or `3`."""
    first, _, last = text.partition("..")
    try:
        numbers = tuple(range(int(first), int(last or first) + 1))
    except ValueError:
        numbers = ()
    if not numbers or not set(numbers) <= set(range(1, MOST_VEHICLES + 1)):
        raise typer.BadParameter(f"{text!r}: allowed is N or N..M, 1 to {MOST_VEHICLES} vehicles")
    return numbers


@dataclass
class _Search:
    """What was flown, and what was found."""

    directory: Path
    found: list[dict[str, Any]] = field(default_factory=list)
    flights: int = 0
    flown_s: float = 0.0
    visited: dict[str, int] = field(default_factory=dict)

    def add(self, flight: "Flight", flown: "Flown", say: Progress) -> None:
        """Note a flight; shrink one that breaks a promise, and write it to a file."""
        from rcopterx_studies.search.flying import fly
        from rcopterx_studies.search.shrinking import shrunk

        self.flights += 1
        self.flown_s += flown.flown_s
        for transition, count in flown.visited.items():
            self.visited[transition] = self.visited.get(transition, 0) + count
        if not flown.findings:
            return
        promise, _, text = flown.findings[0]
        say.say(f"{promise}: {text}; shrinking")
        small = shrunk(flight, lambda one: any(found.promise == promise for found in fly(one).findings))
        self.directory.mkdir(parents=True, exist_ok=True)
        path = self.directory / f"{promise}-{flight.seed}.json"
        small.save(path)
        self.found.append(
            {
                "seed": flight.seed,
                "promise": promise,
                "text": text,
                "happenings": len(small.happenings),
                "file": str(path),
            }
        )


@app.command(rich_help_panel="Try out faults")
def search(
    files: Annotated[
        list[Path] | None, Argument(metavar="FILE", exists=True, help="Fly these flights again.")
    ] = None,
    hours: Annotated[float, Option(metavar="H", min=0, help="For how long to search.")] = 1.0,
    seed: Annotated[int, Option(metavar="N", min=0, help="Seed of the first flight.")] = 0,
    vehicles: Annotated[str, Option(metavar="N..M", help="Number of vehicles.")] = "1..3",
    types: Annotated[
        str, Option(metavar="TYPE,TYPE,...", help="Types of the vehicles.")
    ] = "coaxial,betaflight",
    directory: Annotated[Path, Option(metavar="DIRECTORY", help="For flights that break a promise.")] = Path(
        "found"
    ),
    as_json: JsonOption = False,
) -> None:
    """Fly random fleets in one process until one breaks a promise, and shrink its flight.

    Exit code 1 if a promise was broken.
    """
    import logging

    from rcopterx_studies.search.flights import drawn_flight, read_flight
    from rcopterx_studies.search.flying import fly

    logging.disable(logging.CRITICAL)
    if files:
        broken = False
        for path in files:
            flown = fly(read_flight(path))
            broken = broken or bool(flown.findings)
            lines = [f"{found.promise} at {found.at_s:.3f} s: {found.text}" for found in flown.findings]
            typer.echo(f"{path}: {'; '.join(lines) or 'all promises hold'} (digest {flown.digest})")
        raise typer.Exit(EXIT_FAILED if broken else 0)
    numbers, kinds = _numbers(vehicles), tuple(types.split(","))
    ends_s, result = time.monotonic() + 3600.0 * hours, _Search(directory)
    while time.monotonic() < ends_s or not result.flights:
        flight = drawn_flight(seed + result.flights, numbers, kinds)
        say = Progress(f"seed {flight.seed}")
        flown = fly(flight)
        say.say(f"{len(flight.types)} vehicles, {len(flight.happenings)} happenings, {flown.flown_s:.0f} s")
        result.add(flight, flown, say)
    document = {
        "flights": result.flights,
        "flown_s": round(result.flown_s),
        "found": result.found,
        "transitions": dict(sorted(result.visited.items())),
    }
    print_document(document, as_json, _text)
    if result.found:
        raise typer.Exit(EXIT_FAILED)


def _text(document: dict[str, Any]) -> str:
    lines = [
        f"{one['promise']:12} seed {one['seed']}: {one['text']}; rcopterx search {one['file']}"
        for one in document["found"]
    ]
    transitions = f"{len(document['transitions'])} transitions of arbiters"
    return "\n".join([*lines, f"{document['flights']} flights of {document['flown_s']} s, {transitions}"])
