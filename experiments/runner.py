"""What the experiments share: options, results, and flying every flight on every seed."""

import multiprocessing
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from rcopterx.experiments.kept import KeptFlights
from rcopterx.experiments.knowledge import LEVELS, Knowledge, flies_helicopters
from rcopterx.simulator.conditions import PRESETS, Conditions

T = TypeVar("T")

ShowProgress = Callable[[str, float], None]
"""Called with the label of a flight and the fraction of the experiment that is done."""


@dataclass(frozen=True)
class Options:
    """How an experiment is run.

    Attributes
    ----------
    seeds
        Seeds of the laboratory, one flight each.
    quick
        Short flights, to see that everything works; the figures mean little.
    processes
        Processor cores to use. Flights do not depend on it, measured computing times do.
    preset
        Name of the laboratory's conditions in `rcopterx.simulator.conditions.PRESETS`.
    kept
        Finished flights of an earlier run; new ones are added.
    knowledge
        What pilots know of their vehicles, for experiments that compare that.
    """

    seeds: tuple[int, ...]
    quick: bool = False
    processes: int = 1
    preset: str = "laboratory"
    kept: KeptFlights | None = None
    knowledge: tuple[Knowledge, ...] = LEVELS

    @property
    def conditions(self) -> Conditions:
        """Conditions of the laboratory."""
        return PRESETS[self.preset]

    @property
    def beside_ideal(self) -> dict[str, tuple[int, ...]]:
        """Seeds by preset, with one flight in ideal conditions, which involve no chance.

        Helicopters are flown without it: ideal conditions are those of first-order plants.
        """
        own = {self.preset: self.seeds}
        if flies_helicopters(self.conditions):
            return own
        return {"ideal": self.seeds[:1]} | ({} if self.preset == "ideal" else own)


@dataclass(frozen=True)
class Result:
    """JSON document of an experiment, and a function that draws its figure into a `matplotlib` figure."""

    document: dict[str, Any]
    draw: Callable[[Any], None]


def fly_all(flights: Mapping[str, "partial[T]"], options: Options, show: ShowProgress) -> dict[str, T]:
    """Fly every flight that `options.kept` does not have.

    Parameters
    ----------
    flights
        By label. With one process each is called with `progress`, a function of the fraction flown;
        otherwise it must be picklable and is called without arguments.

    Returns
    -------
    dict
        Results by label, in the order of `flights`.

    Raises
    ------
    KeptFlightsError
        A kept flight has a result of another type.
    """
    kept = options.kept
    results: dict[str, T] = {}
    if kept is not None:
        results = {label: kept.result(label, fly) for label, fly in flights.items() if label in kept}

    def finish(label: str, result: T) -> None:
        results[label] = result
        if kept is not None:
            kept.add(label, result)
        show(label, len(results) / len(flights))

    missing = {label: fly for label, fly in flights.items() if label not in results}
    if options.processes == 1:
        for label, fly in missing.items():
            finish(label, fly(progress=partial(_show_within, show, label, len(results), len(flights))))
    else:
        with ProcessPoolExecutor(options.processes, multiprocessing.get_context("spawn")) as pool:
            futures = {pool.submit(fly): label for label, fly in missing.items()}
            for future in as_completed(futures):
                finish(futures[future], future.result())
    return {label: results[label] for label in flights}


def _show_within(show: ShowProgress, label: str, finished: int, total: int, fraction: float) -> None:
    show(label, (finished + fraction) / total)


def fly_seeds(
    flights: Mapping[str, "partial[T]"], options: Options, show: ShowProgress
) -> dict[str, dict[int, T]]:
    """Fly every flight on every seed in the conditions of the options.

    Parameters
    ----------
    flights
        By name; called with `conditions`, `seed` and perhaps `progress`.

    Returns
    -------
    dict
        Results by name and seed.
    """
    return fly_presets(flights, {options.preset: options.seeds}, options, show)[options.preset]


def fly_presets(
    flights: Mapping[str, "partial[T]"],
    presets: Mapping[str, Sequence[int]],
    options: Options,
    show: ShowProgress,
) -> dict[str, dict[str, dict[int, T]]]:
    """Fly every flight in several conditions, with the seeds of each; results by preset, name and seed."""
    cases = {
        f"{name}, {preset}, seed {seed}": (preset, name, seed)
        for preset, seeds in presets.items()
        for name in flights
        for seed in seeds
    }
    works = {
        label: partial(flights[name], conditions=PRESETS[preset], seed=seed)
        for label, (preset, name, seed) in cases.items()
    }
    results: dict[str, dict[str, dict[int, T]]] = {
        preset: {name: {} for name in flights} for preset in presets
    }
    for label, result in fly_all(works, options, show).items():
        preset, name, seed = cases[label]
        results[preset][name][seed] = result
    return results
