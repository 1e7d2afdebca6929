"""Formations of three helicopters drawn from the family: five minutes of set points, distances and yaw steps.

The sequence of `formation`, flown with the default configuration; every seed draws three other vehicles.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from rcopterx.experiments.formation import FOLLOWERS, SLOT_S, events, formation, sequence
from rcopterx.experiments.knowledge import Knowledge
from rcopterx.experiments.record import rms
from rcopterx.experiments.rig import GUARDED, SETTLED_S, Progress, Rig
from rcopterx.experiments.runner import Options, Result, ShowProgress, fly_seeds
from rcopterx.experiments.schemes import CASCADE
from rcopterx.simulator.conditions import Conditions

TARGETS_MM: Final[Mapping[str, tuple[float, float]]] = MappingProxyType(
    {"default": (45.0, 220.0), "identified": (22.0, 100.0), "exact": (16.0, 70.0)}
)
"""Targets of the worst fleet's root mean square and largest error."""
LOST_M: Final = 0.5
"""Further from its place at the end of the flight, a follower is lost."""


@dataclass(frozen=True)
class Flown:
    """Figures of one fleet, errors those of both followers."""

    rms_mm: float
    max_mm: float
    lost: bool
    touched_floor: bool
    fallbacks: int


def fly_fleet(
    knowledge: Knowledge, quick: bool, conditions: Conditions, seed: int, progress: Progress | None = None
) -> Flown:
    """Fly the whole sequence with one fleet."""
    slots = sequence(quick)
    vehicles = formation(CASCADE.knowing(knowledge), conditions, seed)
    record = Rig(vehicles, conditions, seed, GUARDED).fly((len(slots) + 2) * SLOT_S, events(slots), progress)
    errors_m = record.formation_error_m(SETTLED_S)
    ends_m = [float(record[name].formation_error_m()[-1]) for name in FOLLOWERS]
    return Flown(
        rms_mm=1e3 * rms(errors_m),
        max_mm=1e3 * float(errors_m.max()),
        lost=any(vehicle.left_volume for vehicle in record.vehicles.values()) or not max(ends_m) < LOST_M,
        touched_floor=any(vehicle.touchdowns > 0 for vehicle in record.vehicles.values()),
        fallbacks=sum(record.fallbacks().values()),
    )


def run(options: Options, show: ShowProgress) -> Result:
    """Fly every fleet at every level of knowledge.

    Returns
    -------
    Result
        Document: knowledge -> figures over the fleets, and `per_fleet`.
    """
    flights: dict[str, partial[Flown]] = {
        level: partial(fly_fleet, level, options.quick) for level in options.knowledge
    }
    document = {level: figures(flown) for level, flown in fly_seeds(flights, options, show).items()}
    return Result(document, partial(draw_fleets, document, options.preset))


def figures(fleets: Mapping[int, Flown]) -> dict[str, Any]:
    """Median and worst of the fleets by seed; what went wrong."""
    errors = {name: [getattr(flown, name) for flown in fleets.values()] for name in ("rms_mm", "max_mm")}
    return {
        **{
            name: {"median": round(float(np.median(values)), 1), "worst": round(max(values), 1)}
            for name, values in errors.items()
        },
        "lost": [seed for seed, flown in fleets.items() if flown.lost],
        "touched_floor": [seed for seed, flown in fleets.items() if flown.touched_floor],
        "fallbacks": sum(flown.fallbacks for flown in fleets.values()),
        "per_fleet": {
            str(seed): {"rms_mm": round(flown.rms_mm, 1), "max_mm": round(flown.max_mm, 1)}
            for seed, flown in fleets.items()
        },
    }


def draw_fleets(document: Mapping[str, Any], preset: str, figure: Any) -> None:
    """Draw every fleet's errors, and the targets."""
    figure.set_size_inches(9, 4)
    panels = (("rms_mm", "root mean square [mm]"), ("max_mm", "largest error [mm]"))
    for panel, (axes, (name, label)) in enumerate(zip(figure.subplots(1, 2), panels, strict=True)):
        for index, (level, table) in enumerate(document.items()):
            values = [fleet[name] for fleet in table["per_fleet"].values()]
            axes.plot([level] * len(values), values, "o", color=f"C{index}", alpha=0.6)
            axes.plot([level], [TARGETS_MM[level][panel]], "_", color=f"C{index}", markersize=40)
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.4)
        axes.grid(axis="y", alpha=0.3)
    figure.suptitle(f"Formations of three, conditions `{preset}`; bars: targets of the worst fleet")
    figure.tight_layout()
