"""Several flights of the same row of the table, told as one."""

from collections.abc import Mapping, Sequence
from typing import Any

FIGURES = ("deviation_mm", "drift_mm", "touchdown_m_s", "silence_ms")
Report = dict[str, Any]


def worst_of(runs: Sequence[Report]) -> Report:
    """Report of all runs of a row: passed only if all passed, with the worst figure of each vehicle.

    Checks, problem and states are those of the first run that failed, otherwise of the last one.

    Parameters
    ----------
    runs
        At least one report of the same row.
    """
    told = next((run for run in runs if run["verdict"] == "failed"), runs[-1])
    seen = dict.fromkeys(run["seen"] for run in runs if run["seen"])
    return told | {
        "seen": "; ".join(seen),
        "seconds": round(sum(run["seconds"] for run in runs), 1),
        "runs": len(runs),
        "passed": sum(run["verdict"] == "passed" for run in runs),
        "vehicles": {
            name: vehicle | {figure: _largest(runs, name, figure) for figure in FIGURES}
            for name, vehicle in told["vehicles"].items()
        },
    }


def _largest(runs: Sequence[Mapping[str, Any]], name: str, figure: str) -> float | None:
    figures = [run["vehicles"][name][figure] for run in runs if name in run["vehicles"]]
    return max((value for value in figures if value is not None), default=None)
