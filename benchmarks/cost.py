"""What a fleet costs in this checkout and in another one: whole flights in alternating runs.

Alternating, because a machine is not equally fast from minute to minute. Each run is the checkout's own
`rcopterx bench scale`, so that the other one may be much older than this file.
"""

import json
import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

FIGURES: Final = ("total_share", "agent_share", "p50_ms", "p99_ms", "missed_ticks", "memory_mb")
"""Shares of one processor per vehicle, from pose to command, missed control periods, memory (PSS) of all."""
OWN: Final = Path(__file__).resolve().parents[1]
_FLYING: Final = "s flown"
"""In a line of `bench scale` while it measures."""

Row = Mapping[str, float]
Tell = Callable[[str], None]


class CostError(RuntimeError):
    """A checkout cannot be measured; says why."""


def run(other: Path, vehicles: int, horizon: int, seconds: float, rounds: int, tell: Tell) -> dict[str, Any]:
    """Fly both checkouts in turn; returns the JSON document of `rcopterx bench cost`.

    Parameters
    ----------
    other
        Directory of the other checkout.
    vehicles, horizon
        The fleet that is flown.
    seconds
        How long each flight is measured.
    rounds
        Flights of each checkout.
    tell
        Told what is going on.

    Raises
    ------
    CostError
        The directory is no checkout, or a fleet could not be flown.
    """
    if not (other / "benchmarks" / "scale.py").is_file():
        raise CostError(f"{other} is no checkout of rcopterx with benchmarks/scale.py")
    here: list[Row] = []
    there: list[Row] = []
    for number in range(rounds):
        for rows, checkout in ((here, OWN), (there, other.resolve())):
            tell(f"round {number + 1} of {rounds}: {checkout}")
            rows.append(measured(checkout, vehicles, horizon, seconds))
    return {"vehicles": vehicles, "horizon": horizon, "seconds": seconds} | compared(here, there)


def compared(here: Sequence[Row], there: Sequence[Row]) -> dict[str, Any]:
    """Medians of both, and their ratios; no ratio to zero.

    Parameters
    ----------
    here, there
        Figures of each run.

    Returns
    -------
    dict
        `here`, `there` and `ratio`, each by the names of `FIGURES`.
    """
    medians = [
        {name: statistics.median(row[name] for row in rows) for name in FIGURES} for rows in (here, there)
    ]
    own, others = medians
    ratio = {name: own[name] / others[name] if others[name] else None for name in FIGURES}
    return {"here": own, "there": others, "ratio": ratio}


def measured(checkout: Path, vehicles: int, horizon: int, seconds: float) -> Row:
    """One flight of a checkout, by its own command line.

    Raises
    ------
    CostError
        It did not fly.
    """
    command = [
        sys.executable, "-m", "rcopterx", "bench", "scale", "--json", "--vehicles", str(vehicles),
        "--horizon", str(horizon), "--seconds", f"{seconds:g}",
    ]  # fmt: skip
    environment = os.environ | {"PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"}
    memory_mb, said = 0.0, []
    with subprocess.Popen(
        command, cwd=checkout, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        for line in process.stderr:
            said.append(line.strip())
            if _FLYING in line and not memory_mb:
                memory_mb = memory_of(descendants(process.pid))
        text = process.stdout.read()
    if process.returncode != 0:
        raise CostError(
            f"{checkout}: bench scale ended with {process.returncode}: {said[-1] if said else ''}"
        )
    return figures(json.loads(text)["runs"][0], memory_mb)


def figures(row: Mapping[str, Any], memory_mb: float) -> Row:
    """Figures of a row of `bench scale`.

    Raises
    ------
    CostError
        The fleet could not be flown.
    """
    if row["missed_ticks"] is None:
        raise CostError(f"{row['vehicles']} vehicles did not fly: {row['problem']}")
    shares, vehicles, times = row["cpu_share"], row["vehicles"], row["pose_to_command_ms"]
    return {
        "total_share": sum(shares.values()) / vehicles,
        "agent_share": shares["agent"] / vehicles,
        "p50_ms": times["p50"],
        "p99_ms": times["p99"],
        "missed_ticks": row["missed_ticks"],
        "memory_mb": memory_mb,
    }


def descendants(process: int, proc: Path = Path("/proc")) -> list[int]:
    """Processes that a process has started, directly or not (proc(5), field 4 of stat)."""
    children: dict[int, list[int]] = {}
    for entry in proc.glob("[0-9]*"):
        try:
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
        except (OSError, ValueError, IndexError):
            continue
        children.setdefault(parent, []).append(int(entry.name))
    found, waiting = [], [process]
    while waiting:
        started = children.get(waiting.pop(), [])
        found += started
        waiting += started
    return found


def memory_of(processes: Sequence[int], proc: Path = Path("/proc")) -> float:
    """Memory of processes together, shared pages counted once (PSS) [MB]; one that has ended has none."""
    total_kb = 0
    for process in processes:
        try:
            text = (proc / str(process) / "smaps_rollup").read_text()
        except OSError:
            continue
        total_kb += sum(int(line.split()[1]) for line in text.splitlines() if line.startswith("Pss:"))
    return total_kb / 1000
