"""Formations of three vehicles drawn from a family: five minutes of set points, distances and yaw steps.

The sequence of `formation`, flown with the default configuration; every seed draws three other vehicles. To
learn, they first fly a minute of set points, distances and yaw steps, as agents do in any flight.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

from rcopterx.simulator.conditions import Conditions
from rcopterx_studies.experiments.formation import (
    FOLLOWERS,
    LEADER,
    SLOT_S,
    SLOTS,
    events,
    formation,
    sequence,
)
from rcopterx_studies.experiments.knowledge import LEARNED_LEVELS, Knowledge, learn
from rcopterx_studies.experiments.record import rms
from rcopterx_studies.experiments.rig import GUARDED, SETTLED_S, Progress, Rig
from rcopterx_studies.experiments.runner import Cases, Experiment, Options, median_and_worst
from rcopterx_studies.experiments.schemes import CASCADE

LEARNING_SLOTS: Final = 10  # of `SLOTS`, a minute, before the vehicles learn
RETURN_SLOTS: Final = 3
HOME_M: Final = (0.0, 0.0, 1.0)
LOST_M: Final = 0.5  # further from its place at the end of the flight, a follower is lost


@dataclass(frozen=True)
class FlownFleet:
    """Figures of one fleet, errors those of both followers."""

    rms_mm: float
    max_mm: float
    lost: bool
    touched_floor: bool
    fallbacks: int


def fly_fleet(
    knowledge: Knowledge, quick: bool, conditions: Conditions, seed: int, progress: Progress | None = None
) -> FlownFleet:
    """Fly the whole sequence with one fleet."""
    slots = sequence(quick)
    rig = Rig(formation(replace(CASCADE, knowledge=knowledge), conditions, seed), conditions, seed, GUARDED)
    if knowledge == "learned":
        learn(rig, LEARNING_SLOTS * SLOT_S, events(SLOTS[:LEARNING_SLOTS]))
        back = ((LEADER, HOME_M, 0.0),)
        rig.fly(RETURN_SLOTS * SLOT_S, events((back,), rig.time_s))
    begun_s = rig.time_s
    record = rig.fly((len(slots) + 2) * SLOT_S, events(slots, begun_s), progress)
    errors_m = record.formation_error_m(begun_s + SETTLED_S)
    ends_m = [float(record[name].formation_error_m()[-1]) for name in FOLLOWERS]
    return FlownFleet(
        rms_mm=1e3 * rms(errors_m),
        max_mm=1e3 * float(errors_m.max()),
        lost=any(vehicle.left_volume for vehicle in record.values()) or not max(ends_m) < LOST_M,
        touched_floor=any(vehicle.touchdowns > 0 for vehicle in record.values()),
        fallbacks=sum(record.fallbacks().values()),
    )


def cases(options: Options) -> Cases[FlownFleet]:
    """Every level of knowledge."""
    return {level: partial(fly_fleet, level, options.quick) for level in options.knowledge}


def figures(_: str, fleets: Mapping[int, FlownFleet]) -> dict[str, Any]:
    """Median and worst of the fleets by seed; what went wrong."""
    return {
        "rms_mm": median_and_worst([flown.rms_mm for flown in fleets.values()]),
        "max_mm": median_and_worst([flown.max_mm for flown in fleets.values()]),
        "lost": [seed for seed, flown in fleets.items() if flown.lost],
        "touched_floor": [seed for seed, flown in fleets.items() if flown.touched_floor],
        "fallbacks": sum(flown.fallbacks for flown in fleets.values()),
        "per_fleet": {
            str(seed): {"rms_mm": round(flown.rms_mm, 1), "max_mm": round(flown.max_mm, 1)}
            for seed, flown in fleets.items()
        },
    }


EXPERIMENT: Final = Experiment(
    "fleets",
    "Formations of thirty fleets of drawn vehicles",
    {"helicopters": 30},
    cases,
    figures,
    levels=LEARNED_LEVELS,
)
