"""What the experiments have in common: options, results, and running flights on several processor cores."""

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, TypeVar

from rcopterx.experiments.kept import KeptFlights
from rcopterx.experiments.knowledge import LEVELS, Knowledge, flies_helicopters
from rcopterx.experiments.rig import Progress
from rcopterx.simulator.conditions import PRESETS, Conditions

T = TypeVar("T")

Tell = Callable[[str, float], None]
"""Told what is being flown, and the fraction of the experiment that is done."""


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
        Name of the laboratory's conditions, of `rcopterx.simulator.conditions.PRESETS`.
    kept
        Flights that need not be flown again, and where those that are flown are kept.
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
        """Seeds by preset for experiments that fly once in ideal conditions, too, which know no chance.

        Beside helicopters that would say nothing: nobody knows an ideal one.
        """
        own = {self.preset: self.seeds}
        if flies_helicopters(self.conditions):
            return own
        return {"ideal": self.seeds[:1]} | ({} if self.preset == "ideal" else own)


@dataclass(frozen=True)
class Result:
    """What came out.

    Attributes
    ----------
    document
        JSON document.
    draw
        Draws the figure into an empty `matplotlib.figure.Figure`.
    """

    document: dict[str, Any]
    draw: Callable[[Any], None]


@dataclass(frozen=True)
class Work(Generic[T]):
    """One flight: a label, and a function of how to tell the progress, which another process can be sent."""

    label: str
    run: "partial[T]"


def run_all(works: Sequence[Work[T]], options: Options, tell: Tell) -> list[T]:
    """Do all work that is not kept.

    Parameters
    ----------
    works
        Independent of each other; no two labels are the same.
    options
        Processes to use, of which one stays in this one, and kept flights.
    tell
        Progress; within a flight only if it stays in this process.

    Returns
    -------
    list
        Results in the order of the works.

    Raises
    ------
    KeptFlightsError
        A kept flight is not what this experiment keeps.
    """
    kept = options.kept
    results: dict[str, T] = {}
    if kept is not None:
        results |= {work.label: kept.result(work.label, work.run) for work in works if work.label in kept}
    todo = [work for work in works if work.label not in results]

    def finished(work: Work[T], result: T) -> None:
        results[work.label] = result
        if kept is not None:
            kept.add(work.label, result)
        tell(work.label, len(results) / len(works))

    if options.processes == 1:
        for work in todo:
            done = len(results)
            finished(work, work.run(_within(work.label, done, len(works), tell)))
    else:
        with ProcessPoolExecutor(options.processes, multiprocessing.get_context("spawn")) as pool:
            futures = {pool.submit(work.run, None): work for work in todo}
            for future in as_completed(futures):
                finished(futures[future], future.result())
    return [results[work.label] for work in works]


def _within(label: str, done: int, total: int, tell: Tell) -> Progress:
    return lambda fraction: tell(label, (done + fraction) / total)
