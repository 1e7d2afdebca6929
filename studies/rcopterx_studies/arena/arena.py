"""The arena as an experiment: every chosen scheme flies every chosen task; errors relative to the first."""

import hashlib
import inspect
import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from rcopterx.control.plugins import flying
from rcopterx_studies.arena.flying import TIMES, FlownTask, arena_scheme, figures, fly_task
from rcopterx_studies.arena.tasks import TASKS, quick
from rcopterx_studies.experiments.runner import Cases, Experiment, Options, median_and_worst

OWN: Final = ("rcopterx", "rcopterx_studies")
Document = Mapping[str, Mapping[str, Mapping[str, Any]]]  # figures by task and scheme
Ratios = dict[str, dict[str, Any]]  # by task and scheme
DEFAULT_SCHEMES: Final = (
    "cascade", "paper", "admm", "on_demand", "event_triggered", "consensus", "distributed_lqr"
)  # fmt: skip


def arena(schemes: Sequence[str], tasks: Sequence[str]) -> Experiment[FlownTask]:
    """The experiment for schemes and tasks by name."""

    def cases(options: Options) -> Cases[FlownTask]:
        chosen = [TASKS[name] for name in tasks]
        chosen = [quick(task) for task in chosen] if options.quick else chosen
        return {
            f"{task.name} / {name}": partial(fly_task, arena_scheme(name), task)
            for task in chosen
            for name in schemes
        }

    return Experiment("arena", "Schemes on the same tasks", {"helicopters": 1}, cases, figures)


def digest(document: Document) -> str:
    """Digest of all figures that do not depend on the computer."""
    plain = {
        task: {
            scheme: {name: value for name, value in row.items() if name not in TIMES}
            for scheme, row in rows.items()
        }
        for task, rows in document.items()
    }
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()[:16]


def foreign_digests(schemes: Sequence[str]) -> dict[str, str]:
    """Digests of the sources of schemes from other packages, whose kept flights are valid for these only."""
    found = {}
    for name in schemes:
        kind = flying(name).load(name)
        if kind.__module__.partition(".")[0] not in OWN:
            source = Path(inspect.getfile(kind))
            found[name] = hashlib.sha256(source.read_bytes()).hexdigest()[:16]
    return found


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
