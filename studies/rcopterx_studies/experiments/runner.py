"""Experiments as data, and flying every case of one on every seed."""

import multiprocessing
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Generic, TypeVar

import numpy as np

from rcopterx.deploy.roles.run import end_with
from rcopterx.simulator.conditions import PRESETS, Conditions
from rcopterx_studies.experiments.kept import KeptFlights
from rcopterx_studies.experiments.knowledge import LEVELS, Knowledge

T = TypeVar("T")

ShowProgress = Callable[[str, float], None]
"""Called with the label of a flight and the fraction of the experiment that is done."""
Cases = Mapping[str, partial[T]]
"""Functions of `conditions`, `seed` and perhaps `progress` by name; ` / ` in a name groups its figures."""

FIRST_REPORTED_VEHICLE: Final = 100
"""Helicopters drawn with smaller seeds are for tuning; reported figures use those from here on."""
BOOTSTRAP_DRAWS: Final = 10_000


@dataclass(frozen=True)
class Options:
    """How an experiment is run."""

    seeds: tuple[int, ...]  # seeds of the laboratory, one flight each
    quick: bool = False  # short flights, to see that everything works; the figures mean little
    processes: int = 1  # processor cores to use; flights do not depend on it
    # name of the laboratory's conditions in `rcopterx.simulator.conditions.PRESETS`
    preset: str = "laboratory"
    kept: KeptFlights | None = None  # finished flights of an earlier run; new ones are added
    # what pilots know of their vehicles, for experiments that compare that
    knowledge: tuple[Knowledge, ...] = LEVELS

    @property
    def conditions(self) -> Conditions:
        """Conditions of the laboratory."""
        return PRESETS[self.preset]


@dataclass(frozen=True)
class FlightResult(Generic[T]):
    """Outcome of an experiment."""

    options: Options
    flown: Mapping[str, Mapping[int, T]]  # results of flights by case and seed
    document: dict[str, Any]  # the JSON document of its figures


@dataclass(frozen=True)
class Experiment(Generic[T]):
    """One experiment."""

    name: str
    title: str
    # number of seeds for each preset that is flown by default; other presets take as many as the first
    flights: Mapping[str, int]
    cases: Callable[[Options], Cases[T]]  # what is flown with the given options
    # part of the JSON document about the flights of one case, by seed
    figures: Callable[[str, Mapping[int, T]], dict[str, Any]]
    # draws a result into an empty `matplotlib` figure
    draw: Callable[[FlightResult[T], Any], None] | None = None
    # levels of `Options.knowledge` at which it flies; none if it does not compare them
    levels: tuple[Knowledge, ...] = ()
    helicopters_only: bool = False  # whether it needs conditions with helicopters

    def seeds(self, preset: str) -> tuple[int, ...]:
        """Consecutive seeds for a preset."""
        drawn = PRESETS[preset].coaxial_plant.startswith("drawn_")
        first = FIRST_REPORTED_VEHICLE if drawn else 0
        count = self.flights.get(preset, next(iter(self.flights.values())))
        return tuple(range(first, first + count))

    def fly(self, options: Options, show: ShowProgress) -> FlightResult[T]:
        """Fly every case on every seed; `FleetError`: a kept flight has a result of another type."""

        def label(case: str, seed: int) -> str:
            return f"{case}, {options.preset}, seed {seed}"

        cases = self.cases(options)
        flights = {
            label(name, seed): partial(case, conditions=options.conditions, seed=seed)
            for name, case in cases.items()
            for seed in options.seeds
        }
        results = fly_all(flights, options, show)
        flown = {name: {seed: results[label(name, seed)] for seed in options.seeds} for name in cases}
        return FlightResult(options, flown, self._document(flown))

    def _document(self, flown: Mapping[str, Mapping[int, T]]) -> dict[str, Any]:
        document: dict[str, Any] = {}
        for name, by_seed in flown.items():
            *groups, last = name.split(" / ")
            place = document
            for group in groups:
                place = place.setdefault(group, {})
            place[last] = self.figures(name, by_seed)
        return document


def fly_all(flights: Mapping[str, "partial[T]"], options: Options, show: ShowProgress) -> dict[str, T]:
    """Fly every flight that `options.kept` does not have; returns results by label, in the given order.

    With one process each flight is called with `progress`, a function of the fraction flown; otherwise it
    must be picklable and is called without arguments. Errors are those of `Experiment.fly`.
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

    def show_within(label: str, fraction: float) -> None:
        show(label, (len(results) + fraction) / len(flights))

    missing = {label: fly for label, fly in flights.items() if label not in results}
    if options.processes == 1:
        for label, fly in missing.items():
            finish(label, fly(progress=partial(show_within, label)))
    else:
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(options.processes, spawn, end_with, (os.getpid(),)) as pool:
            futures = {pool.submit(fly): label for label, fly in missing.items()}
            for future in as_completed(futures):
                finish(futures[future], future.result())
    return {label: results[label] for label in flights}


def median_and_worst(values: Sequence[float]) -> dict[str, Any]:
    """Median with its 95 % interval (percentile bootstrap), and largest, of figures of several vehicles."""
    drawn = np.random.default_rng(0).choice(values, (BOOTSTRAP_DRAWS, len(values)))
    low, high = np.percentile(np.median(drawn, axis=1), (2.5, 97.5)).round(1).tolist()
    middle, worst = np.round((np.median(values), np.max(values)), 1).tolist()
    return {"median": middle, "median_95%": [low, high], "worst": worst}
