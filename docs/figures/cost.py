"""Compare this checkout with another one: processor time, latency, memory, fleet size, control steps.

    python docs/figures/cost.py CHECKOUT [--json] [--only TRIAL ...] [--rounds N]

Each trial is a command of the checkout's own command line, so that the other one may be much older. Both
alternate, because the speed of a computer varies. Ratios are of medians.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rcopterx.commands.output import Progress
from rcopterx_studies.benchmarks.processes import Show, descendants, memory_of

OWN: Final = Path(__file__).resolve().parents[2]
_FLYING: Final = "s flown"  # in a line of `bench scale` while it measures
SECONDS: Final = 20.0
LARGEST_SECONDS: Final = 60.0
LARGEST_SIZES: Final = "2,3,4,5,6,8,10,12,14,16,18,20,24"

Figures = dict[str, float]


class CostError(ChildProcessError):
    """A checkout cannot be measured; the message says why."""


@dataclass(frozen=True)
class Trial:
    """A command of `rcopterx` that is run in both checkouts; `figures` takes figures from its document."""

    arguments: tuple[str, ...]
    figures: Callable[[Any], Figures]


def fleet_figures(document: Any) -> Figures:
    """Share of a processor per vehicle, and latency, of `bench scale` with one fleet; raises `CostError`."""
    (row,) = document["runs"]
    if row["missed_ticks"] is None:
        raise CostError(f"{row['vehicles']} vehicles did not fly: {row['problem']}")
    vehicles, times = row["vehicles"], row["pose_to_command_ms"]
    shares = {f"{role}_share": share / vehicles for role, share in row["cpu_share"].items()}
    return shares | {
        "total_share": sum(shares.values()),
        "pose_to_command_p50_ms": times["p50"],
        "pose_to_command_p99_ms": times["p99"],
        "missed_periods": row["missed_ticks"],
    }


def manoeuvre_figures(document: Any) -> Figures:
    """Figures of a manoeuvre that was flown to its end, passed or not; else raises `CostError`."""
    if document["frame_to_radio_ms"] is None:
        raise CostError(f"{document['manoeuvre']}: {document['problem']}")
    return {"frame_to_radio_p99_ms": document["frame_to_radio_ms"]["p99"]}


def step_figures(document: Any) -> Figures:
    """Of `bench solver` at one horizon: control steps of the default controller."""
    (contestants,) = document["horizons"].values()
    return {"mean_ms": contestants["cascade"]["mean_ms"], "p999_ms": contestants["cascade"]["p999_ms"]}


def largest_figures(document: Any) -> Figures:
    """Of `bench scale` with several fleets."""
    return {"largest_fleet": document["largest_fleet"]}


def _scale(vehicles: str, horizon: int, seconds: float) -> tuple[str, ...]:
    return (
        "bench", "scale", "--json", "--vehicles", vehicles, "--horizon", str(horizon), "--seconds",
        f"{seconds:g}",
    )  # fmt: skip


TRIALS: Final[Mapping[str, Trial]] = {
    "six": Trial(_scale("6", 30, SECONDS), fleet_figures),
    "trio": Trial(_scale("3", 50, SECONDS), fleet_figures),
    "radio": Trial(("fly", "hover", "--up", "--json"), manoeuvre_figures),
    "step": Trial(("bench", "solver", "--json", "--horizons", "110", "--steps", "200"), step_figures),
    "largest": Trial(_scale(LARGEST_SIZES, 30, LARGEST_SECONDS), largest_figures),
}


def run(other: Path, names: Sequence[str], rounds: int, show: Show) -> dict[str, Any]:
    """Run trials in both checkouts in turn; return the document that is printed. Raises `CostError`."""
    if not (other / "rcopterx" / "__init__.py").is_file():
        raise CostError(f"{other} is no checkout of rcopterx")
    document: dict[str, Any] = {"against": str(other.resolve()), "rounds": rounds, "trials": {}, "failed": {}}
    for name in names:
        try:
            document["trials"][name] = _in_turns(name, other.resolve(), rounds, show)
        except CostError as error:
            document["failed"][name] = str(error)
    return document


def _in_turns(name: str, other: Path, rounds: int, show: Show) -> dict[str, dict[str, Any]]:
    """Run a trial in both checkouts in turn, and compare the figures."""
    here: list[Figures] = []
    there: list[Figures] = []
    for number in range(rounds):
        for rows, checkout in ((here, OWN), (there, other)):
            show(f"{name}, round {number + 1} of {rounds}: {checkout}")
            rows.append(measured(TRIALS[name], checkout))
    return compared(here, there)


def compared(here: Sequence[Figures], there: Sequence[Figures]) -> dict[str, dict[str, Any]]:
    """Medians `here` and `there` of figures that both checkouts have, and their `ratio` (None to zero)."""
    found = {}
    for name in sorted(here[0].keys() & there[0].keys()):
        own, others = (statistics.median(row[name] for row in rows) for rows in (here, there))
        found[name] = {"here": own, "there": others, "ratio": own / others if others else None}
    return found


def measured(trial: Trial, checkout: Path) -> Figures:
    """Figures of a trial by a checkout's own command line; raises `CostError` without a JSON document."""
    environment = os.environ | {
        "PYTHONPATH": f"{checkout}:{checkout / 'studies'}",
        "OPENBLAS_NUM_THREADS": "1",
    }
    memory_mb, last_line = 0.0, ""
    python = checkout / ".venv" / "bin" / "python"
    with subprocess.Popen(
        [str(python) if python.is_file() else sys.executable, "-m", "rcopterx", *trial.arguments],
        cwd=checkout,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        for line in process.stderr:
            last_line = line.strip()
            if _FLYING in line and not memory_mb:
                memory_mb = memory_of(descendants(process.pid))
        text = process.stdout.read()
    try:
        # A manoeuvre that fails a check ends with 1 and prints its figures, too.
        document = json.loads(text)
    except ValueError:
        raise CostError(
            f"{checkout}: {' '.join(trial.arguments)} ended with {process.returncode}: {last_line}"
        ) from None
    return trial.figures(document) | ({"memory_mb": memory_mb} if memory_mb else {})


def table(document: Mapping[str, Any]) -> list[str]:
    """Table of the figures."""
    lines = [f"{'':40}{'here':>9}{'there':>9}{'ratio':>7}"]
    for name, figures in document["trials"].items():
        for figure, row in figures.items():
            ratio = "-" if row["ratio"] is None else f"{row['ratio']:.2f}"
            lines.append(f"{f'{name}: {figure}':40}{row['here']:>9.3f}{row['there']:>9.3f}{ratio:>7}")
    return lines


def main() -> None:
    """Print how this checkout compares with another one; exit code 1 if a trial failed."""
    parser = argparse.ArgumentParser(
        description="Compare this checkout with another one, in alternating runs."
    )
    parser.add_argument("checkout", type=Path, metavar="CHECKOUT", help="checkout to compare this one with")
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument(
        "--only", nargs="+", choices=TRIALS, default=[*TRIALS][:-1], metavar="TRIAL",
        help=f"trials: {', '.join(TRIALS)} (default: all but the last one, which takes long)",
    )  # fmt: skip
    parser.add_argument("--rounds", type=int, default=3, metavar="N", help="measurements of each kind")
    arguments = parser.parse_args()
    try:
        document = run(arguments.checkout, arguments.only, arguments.rounds, Progress("cost").say)
    except CostError as error:
        sys.exit(str(error))
    print(json.dumps(document, indent=2) if arguments.json else "\n".join(table(document)))
    if document["failed"]:
        sys.exit("\n".join(f"{name}: {problem}" for name, problem in document["failed"].items()))


if __name__ == "__main__":
    main()
