"""What the experiments have in common: options, results, and running flights on several processor cores."""

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from rcopterx.experiments.knowledge import flies_helicopters
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
    """

    seeds: tuple[int, ...]
    quick: bool = False
    processes: int = 1
    preset: str = "laboratory"

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
    """One flight: a label and a function that another process can be sent."""

    label: str
    run: Callable[[Progress | None], T]


def run_all(works: Sequence[Work[T]], processes: int, tell: Tell) -> list[T]:
    """Do all work.

    Parameters
    ----------
    works
        Independent of each other.
    processes
        Processes to use; 1 stays in this one.
    tell
        Progress; within a flight only if it stays in this process.

    Returns
    -------
    list
        Results in the order of the works.
    """
    if processes == 1:
        return [_run_here(work, done, len(works), tell) for done, work in enumerate(works)]
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        futures = {pool.submit(work.run, None): work for work in works}
        for done, future in enumerate(as_completed(futures), 1):
            future.result()
            tell(futures[future].label, done / len(works))
        return [future.result() for future in futures]


def _run_here(work: Work[T], done: int, total: int, tell: Tell) -> T:
    result = work.run(lambda fraction: tell(work.label, (done + fraction) / total))
    tell(work.label, (done + 1) / total)
    return result
