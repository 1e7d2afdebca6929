"""Reports of fault flights."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from rcopterx_studies.faults.bench import FaultFlight
from rcopterx_studies.faults.promise import Check, SeenFlight, judged, judged_take_off, outcome

FIGURES: Final = ("deviation_mm", "drift_mm", "touchdown_m_s", "silence_ms", "highest_m")
Report = dict[str, Any]


def report_of(
    row: FaultFlight,
    seen: Mapping[str, SeenFlight],
    problem: str | None,
    seconds: float,
    broken: Sequence[str] = (),
    reported: Sequence[str] = (),
) -> Report:
    """Report of a row that was flown; `problem` is what ended it early.

    `broken` as in `judged`; `reported` are the lines that users see about a take-off.
    """
    checks: list[Check] = []
    if seen and row.take_off is not None:
        checks = judged_take_off(seen, row.allowed, row.take_off.cause, reported, broken)
    elif seen:
        checks = judged(row.promise, row.down, row.allowed, seen, broken)
    passed = problem is None and bool(checks) and all(check["passed"] for check in checks)
    return not_flown(row, problem) | {
        "verdict": "passed" if passed else "failed",
        "seen": outcome(row.promise, seen),
        "checks": checks,
        "vehicles": {
            name: {figure: getattr(vehicle, figure) for figure in FIGURES}
            | {"arbiter": list(vehicle.states_of_arbiter)}
            for name, vehicle in seen.items()
        },
        "seconds": round(seconds, 1),
    }


def not_flown(row: FaultFlight, problem: str | None) -> Report:
    """Report of a row that was not flown."""
    return {
        "name": row.name,
        "title": row.title,
        "promise": row.promise.value,
        "down": list(row.down),
        "verdict": "not flown",
        "problem": problem,
        "seen": "",
        "checks": [],
        "vehicles": {},
        "seconds": 0.0,
    }


def worst_of(runs: Sequence[Report]) -> Report:
    """Merge reports of the same row, of which there is at least one.

    It passed only if all passed, and has the worst figures of each vehicle. Checks, problem and states are
    those of the first run that failed, otherwise of the last one.
    """
    shown = next((run for run in runs if run["verdict"] == "failed"), runs[-1])
    seen = dict.fromkeys(run["seen"] for run in runs if run["seen"])
    return shown | {
        "seen": "; ".join(seen),
        "seconds": round(sum(run["seconds"] for run in runs), 1),
        "runs": len(runs),
        "passed": sum(run["verdict"] == "passed" for run in runs),
        "vehicles": {
            name: vehicle | {figure: _largest(runs, name, figure) for figure in FIGURES}
            for name, vehicle in shown["vehicles"].items()
        },
    }


def _largest(runs: Sequence[Mapping[str, Any]], name: str, figure: str) -> float | None:
    figures = [run["vehicles"][name][figure] for run in runs if name in run["vehicles"]]
    return max((value for value in figures if value is not None), default=None)
