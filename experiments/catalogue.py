"""The experiments that reproduce the paper's figures, by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from rcopterx.experiments import (
    beyond,
    chain,
    family,
    fleets,
    formation,
    horizon,
    hover,
    preview,
    swapping,
    tuning,
    turning,
)
from rcopterx.experiments.runner import Options, Result, ShowProgress
from rcopterx.simulator.conditions import PRESETS

FIRST_REPORTED_VEHICLE: Final = 100
"""Helicopters drawn with smaller seeds are for tuning; reported figures use those from here on."""


@dataclass(frozen=True)
class Experiment:
    """One row of the table.

    Attributes
    ----------
    flights
        Number of seeds for each preset that is flown by default; other presets take as many as the first.
    first_seed
        Default of the first seed; None chooses it by the conditions.
    compares_knowledge
        Whether it flies at every level of `Options.knowledge`.
    """

    name: str
    title: str
    flights: Mapping[str, int]
    run: Callable[[Options, ShowProgress], Result]
    first_seed: int | None = None
    compares_knowledge: bool = False

    def seeds(self, preset: str, first: int | None = None) -> tuple[int, ...]:
        """Consecutive seeds for a preset."""
        if first is None:
            first = self.first_seed
        if first is None:
            drawn = PRESETS[preset].coaxial_plant == "drawn_helicopter"
            first = FIRST_REPORTED_VEHICLE if drawn else 0
        count = self.flights.get(preset, next(iter(self.flights.values())))
        return tuple(range(first, first + count))


_ROWS: Final = (
    Experiment(
        "hover",
        "Fig. 1: hovering errors of [11], the paper and the cascade",
        {"laboratory": 3, "helicopters": 5},
        hover.run,
    ),
    Experiment(
        "horizon",
        "Fig. 2: computing time and tracking error against the horizon",
        {"laboratory": 3},
        horizon.run,
    ),
    Experiment(
        "formation",
        "Fig. 3: formation errors of every scheme over five minutes",
        {"laboratory": 5, "helicopters": 2},
        formation.run,
    ),
    Experiment(
        "preview",
        "A figure-eight with and without preview and feed-forward",
        {"laboratory": 3, "helicopters": 3},
        preview.run,
    ),
    Experiment("chain", "Errors along chains, trees and with several leaders", {"laboratory": 3}, chain.run),
    Experiment(
        "turning", "Yaw steps of a leader whose followers turn with it", {"laboratory": 3}, turning.run
    ),
    Experiment(
        "swapping",
        "Ten vehicles swap places without collision",
        {"laboratory": 5, "helicopters": 2},
        swapping.run,
    ),
    Experiment(
        "family",
        "Fifty drawn helicopters hover, step, turn and fly an eight",
        {"helicopters": 50},
        family.run,
        compares_knowledge=True,
    ),
    Experiment(
        "fleets",
        "Formations of ten fleets of drawn helicopters",
        {"helicopters": 10},
        fleets.run,
        compares_knowledge=True,
    ),
    Experiment(
        "beyond",
        "Helicopters further off than any of the family",
        {"helicopters": 3},
        beyond.run,
        first_seed=0,
    ),
    Experiment(
        "tuning",
        "Candidates from which the simple schemes got their settings for helicopters",
        {"helicopters": 4},
        tuning.run,
        first_seed=0,
    ),
)
EXPERIMENTS: Final = MappingProxyType({row.name: row for row in _ROWS})
