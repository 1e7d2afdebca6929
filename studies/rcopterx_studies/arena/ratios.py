"""Errors of schemes over those of another one, fleet by fleet."""

from collections.abc import Mapping, Sequence
from typing import Any

from rcopterx_studies.arena.flying import FlownTask
from rcopterx_studies.experiments.runner import median_and_worst

Ratios = dict[str, dict[str, Any]]  # by task and scheme


def error_ratios(
    flown: Mapping[str, Mapping[int, FlownTask]], tasks: Sequence[str], schemes: Sequence[str]
) -> Ratios:
    """Return formation errors of the other schemes over those of the first one, in the same flights.

    `flown`: flights by `task / scheme` and seed. Ratios of `rms` and `max` have their median over the seeds
    with its 95 % interval, and the largest. Tasks without followers have no errors and are left out.
    """
    first, *others = schemes
    bases = {task: flown[f"{task} / {first}"] for task in tasks}
    return {
        task: {name: _ratios(base, flown[f"{task} / {name}"]) for name in others}
        for task, base in bases.items()
        if all(flight.rms_mm > 0.0 for flight in base.values())
    }


def _ratios(base: Mapping[int, FlownTask], rival: Mapping[int, FlownTask]) -> dict[str, Any]:
    return {
        "rms": median_and_worst([rival[seed].rms_mm / base[seed].rms_mm for seed in base]),
        "max": median_and_worst([rival[seed].max_mm / base[seed].max_mm for seed in base]),
    }
