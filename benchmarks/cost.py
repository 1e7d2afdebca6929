"""Comparison of this checkout with another one: processor time, latency, memory, fleet size, control steps.

Each trial is a command of the checkout's own command line, so that the other one may be much older. Both
alternate, because the speed of a computer varies. Ratios are of medians.
"""

import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rcopterx.benchmarks.processes import Show, descendants, memory_of

OWN: Final = Path(__file__).resolve().parents[1]
_FLYING: Final = "s flown"
"""In a line of `bench scale` while it measures."""
SECONDS: Final = 20.0
LARGEST_SECONDS: Final = 60.0
LARGEST_SIZES: Final = "2,3,4,5,6,8,10,12,14,16,18,20,24"

Figures = dict[str, float]


class CostError(RuntimeError):
    """A checkout cannot be measured; the message says why."""


@dataclass(frozen=True)
class Target:
    """Target of the ratio of a figure to the other checkout's: an upper limit unless more is better."""

    title: str
    ratio: float
    more_is_better: bool = False

    def met(self, ratio: float) -> bool:
        """Whether a ratio is good enough."""
        return ratio >= self.ratio if self.more_is_better else ratio <= self.ratio


@dataclass(frozen=True)
class Trial:
    """A command of `rcopterx` that is run in both checkouts.

    `figures` takes figures from its JSON document and the memory of its processes [MB]; some have targets.
    """

    arguments: tuple[str, ...]
    figures: Callable[[Any, float], Figures]
    targets: Mapping[str, Target]


def fleet_figures(document: Any, memory_mb: float) -> Figures:
    """Of `bench scale` with one fleet: shares of one processor per vehicle, latency, memory.

    Raises
    ------
    CostError
        The fleet could not be flown.
    """
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
        "memory_mb": memory_mb,
    }


def manoeuvre_figures(document: Any, _: float) -> Figures:
    """Of a flown manoeuvre, whether it passed its checks or not.

    Raises
    ------
    CostError
        It was not flown to its end.
    """
    if document["frame_to_radio_ms"] is None:
        raise CostError(f"{document['manoeuvre']}: {document['problem']}")
    return {"frame_to_radio_p99_ms": document["frame_to_radio_ms"]["p99"]}


def step_figures(document: Any, _: float) -> Figures:
    """Of `bench solver` at one horizon: control steps of the default controller."""
    (contestants,) = document["horizons"].values()
    return {"mean_ms": contestants["cascade"]["mean_ms"], "p999_ms": contestants["cascade"]["p999_ms"]}


def largest_figures(document: Any, _: float) -> Figures:
    """Of `bench scale` with several fleets."""
    return {"largest_fleet": document["largest_fleet"]}


def _scale(vehicles: str, horizon: int, seconds: float) -> tuple[str, ...]:
    return (
        "bench", "scale", "--json", "--vehicles", vehicles, "--horizon", str(horizon), "--seconds",
        f"{seconds:g}",
    )  # fmt: skip


TRIALS: Final[Mapping[str, Trial]] = {
    "six": Trial(
        _scale("6", 30, SECONDS),
        fleet_figures,
        {"total_share": Target("processor time per vehicle, all processes, 6 vehicles, N = 30", 0.45)},
    ),
    "trio": Trial(
        _scale("3", 50, SECONDS),
        fleet_figures,
        {
            "agent_share": Target("processor time of an agent, N = 50", 0.4),
            "pose_to_command_p50_ms": Target("pose to command, p50, 3 vehicles, N = 50", 0.7),
            "pose_to_command_p99_ms": Target("pose to command, p99, 3 vehicles, N = 50", 0.7),
            "memory_mb": Target("memory of all processes (PSS), 3 vehicles", 0.7),
        },
    ),
    "radio": Trial(
        ("fly", "hover", "--up", "--json"),
        manoeuvre_figures,
        {"frame_to_radio_p99_ms": Target("frame to radio, p99, 3 vehicles", 0.8)},
    ),
    "step": Trial(
        ("bench", "solver", "--json", "--horizons", "110"),
        step_figures,
        {
            "mean_ms": Target("control step, N = 110, mean", 0.5),
            "p999_ms": Target("control step, N = 110, p99.9", 0.6),
        },
    ),
    "largest": Trial(
        _scale(LARGEST_SIZES, 30, LARGEST_SECONDS),
        largest_figures,
        {"largest_fleet": Target("largest fleet without a missed period, N = 30", 2.0, more_is_better=True)},
    ),
}


def run(other: Path, names: Sequence[str], rounds: int, show: Show) -> dict[str, Any]:
    """Run the trials `names` in both checkouts in turn; returns the JSON document of `rcopterx bench cost`.

    Raises
    ------
    CostError
        The directory is not a checkout, or a trial failed.
    """
    if not (other / "benchmarks" / "scale.py").is_file():
        raise CostError(f"{other} is no checkout of rcopterx with benchmarks/scale.py")
    document: dict[str, Any] = {"against": str(other.resolve()), "rounds": rounds, "trials": {}}
    for name in names:
        trial = TRIALS[name]
        here: list[Figures] = []
        there: list[Figures] = []
        for number in range(rounds):
            for rows, checkout in ((here, OWN), (there, other.resolve())):
                show(f"{name}, round {number + 1} of {rounds}: {checkout}")
                rows.append(measured(trial, checkout))
        document["trials"][name] = compared(trial, here, there)
    return document


def compared(trial: Trial, here: Sequence[Figures], there: Sequence[Figures]) -> dict[str, dict[str, Any]]:
    """Compare the runs of a trial in both checkouts.

    Returns
    -------
    dict
        For each figure of both `here`, `there`, `ratio` (None to zero), and with a target `title`, `target`,
        `met`.
    """
    found: dict[str, dict[str, Any]] = {}
    for name in here[0].keys() & there[0].keys():
        own, others = (statistics.median(row[name] for row in rows) for rows in (here, there))
        ratio = own / others if others else None
        found[name] = {"here": own, "there": others, "ratio": ratio}
        target = trial.targets.get(name)
        if target is not None:
            met = ratio is not None and target.met(ratio)
            found[name] |= {"title": target.title, "target": target.ratio, "met": met}
    return dict(sorted(found.items()))


def measured(trial: Trial, checkout: Path) -> Figures:
    """Figures of a trial, run once by a checkout's own command line.

    Raises
    ------
    CostError
        The command printed no JSON document.
    """
    environment = os.environ | {"PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"}
    memory_mb, last_line = 0.0, ""
    with subprocess.Popen(
        [sys.executable, "-m", "rcopterx", *trial.arguments],
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
    return trial.figures(document, memory_mb)


def table(document: Mapping[str, Any]) -> list[str]:
    """Table of the figures, those with a target first."""
    lines = [f"{'':62}{'here':>9}{'there':>9}{'ratio':>7}{'target':>8}"]
    rest = [""]
    for name, figures in document["trials"].items():
        for figure, row in figures.items():
            ratio = "-" if row["ratio"] is None else f"{row['ratio']:.2f}"
            values = f"{row['here']:>9.3f}{row['there']:>9.3f}{ratio:>7}"
            if "title" in row:
                verdict = "met" if row["met"] else "missed"
                lines.append(f"{row['title']:62}{values}{row['target']:>8.2f} {verdict}")
            else:
                rest.append(f"{f'{name}: {figure}':62}{values}")
    return lines + rest
