"""Ten vehicles on a circle swap places: collision avoidance by published plans.

All vehicles leave at the same moment for the opposite place, or for a place drawn at random, so that their
paths cross in the middle. The pilots know each other's plans as on the bus; nothing else coordinates them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any, Final

import numpy as np

from rcopterx.agents.separation.avoidance import SeparationEllipsoid
from rcopterx.experiments.events import GoTo
from rcopterx.experiments.figures import finish_figure
from rcopterx.experiments.rig import Progress, Rig, RigOptions
from rcopterx.experiments.runner import Cases, Experiment, Options, Result
from rcopterx.experiments.schemes import CASCADE
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import Pose
from rcopterx.transmitter_gateway.limits import SurveillanceLimits
from rcopterx.vehicles.state import Array
from rcopterx.vehicles.tuples import three
from rcopterx.vehicles.types import COAXIAL_LAG

VEHICLES: Final = 10
QUICK_VEHICLES: Final = 4
RADIUS_M: Final = 0.8
HEIGHT_M: Final = 1.0
START_S: Final = 2.0
"""When all vehicles leave; estimators have settled by then."""
FLIGHT_S: Final = 14.0
QUICK_FLIGHT_S: Final = 8.0
ARRIVED_M: Final = 0.1
HARD_M: Final = SurveillanceLimits().minimum_distance_m or 0.0
"""Distance below which transmitter gateways hold vehicles."""
CLEARANCE: Final = SeparationEllipsoid()

ANTIPODES: Final = "antipodes"
RANDOM: Final = "random"
WITHOUT: Final = "without_avoidance"
CASES: Final = {
    ANTIPODES: ("opposite places", "C0"),
    RANDOM: ("places at random", "C1"),
    WITHOUT: ("without avoidance", "0.6"),
}
"""Titles and colours in the figure; without avoidance for comparison."""


@dataclass(frozen=True)
class Swap:
    """One flight.

    True positions `tracks_m` have shape (K, vehicles, 3), times since departure (K,), goals (vehicles, 3).
    `avoiding_ticks` are control periods with separation constraints, of all vehicles together.
    """

    tracks_m: Array
    time_s: Array
    goals_m: Array
    fallbacks: Mapping[str, int]
    avoiding_ticks: int
    ticks: int

    def gaps_m(self) -> Array:
        """Gaps of all pairs, shape (K, pairs, 3)."""
        first, second = np.array(list(combinations(range(self.tracks_m.shape[1]), 2))).T
        return np.asarray(self.tracks_m[:, first] - self.tracks_m[:, second])

    def nearest_m(self) -> Array:
        """Smallest distance of any two vehicles, shape (K,)."""
        return np.asarray(np.linalg.norm(self.gaps_m(), axis=2).min(axis=1))

    def outside_m(self) -> float:
        """Farthest that any vehicle was outside the volume in which it plans."""
        low, high = np.array(COAXIAL_LAG.state_min[:3]), np.array(COAXIAL_LAG.state_max[:3])
        return float(np.maximum(self.tracks_m - high, low - self.tracks_m).max(initial=0.0))

    def finished_s(self) -> float | None:
        """When the last vehicle was at its goal to stay; None if one is not."""
        away = (np.linalg.norm(self.tracks_m - self.goals_m, axis=2) > ARRIVED_M).any(axis=1)
        if away[-1]:
            return None
        return float(self.time_s[away].max(initial=0.0))


def places(vehicles: int) -> Array:
    """Places on the circle, shape (vehicles, 3)."""
    angle = 2 * np.pi * np.arange(vehicles) / vehicles
    across = RADIUS_M * np.column_stack((np.cos(angle), np.sin(angle)))
    return np.column_stack((across, np.full(vehicles, HEIGHT_M)))


def goals_of(case: str, vehicles: int, seed: int) -> Array:
    """Places in the order of the vehicles that go there, shape (vehicles, 3)."""
    number = np.arange(vehicles)
    if case == RANDOM:
        order = np.random.default_rng(seed).permutation(number)
    else:
        order = (number + vehicles // 2) % vehicles
    return np.asarray(places(vehicles)[order])


def fly_swap(
    case: str, quick: bool, conditions: Conditions, seed: int, progress: Progress | None = None
) -> Swap:
    """Fly one swap."""
    count = QUICK_VEHICLES if quick else VEHICLES
    starts, goals = places(count), goals_of(case, count, seed)
    names = [f"h{number + 1}" for number in range(count)]
    vehicles = [
        CASCADE.vehicle(name, Pose(three(place)), conditions, seed)
        for name, place in zip(names, starts, strict=True)
    ]
    options = RigOptions(clearance=None if case == WITHOUT else CLEARANCE)
    rig = Rig(vehicles, conditions, seed, options)
    events = [GoTo(START_S, name, three(goal)) for name, goal in zip(names, goals, strict=True)]
    record = rig.fly(QUICK_FLIGHT_S if quick else FLIGHT_S, events, progress)
    rows = record[names[0]].time_s >= START_S
    return Swap(
        np.stack([record[name].motion[rows, :3] for name in names], axis=1),
        record[names[0]].time_s[rows] - START_S,
        goals,
        record.fallbacks(),
        sum(rig.pilots[name].avoidance.ticks for name in names),
        sum(len(record[name].time_s) for name in names),
    )


def cases(options: Options) -> Cases[Swap]:
    """Every case."""
    return {case: partial(fly_swap, case, options.quick) for case in CASES}


def figures(_: str, swaps: Mapping[int, Swap]) -> dict[str, Any]:
    """Figures of each flight by seed."""
    return {str(seed): figures_of(swap) for seed, swap in swaps.items()}


def figures_of(swap: Swap) -> dict[str, Any]:
    """Figures of a flight."""
    finished_s = swap.finished_s()
    return {
        "minimum_distance_m": round(float(swap.nearest_m().min()), 3),
        "minimum_in_ellipsoids": round(float(CLEARANCE.normalised(swap.gaps_m()).min()), 3),
        "finished_s": None if finished_s is None else round(finished_s, 2),
        "outside_m": round(swap.outside_m(), 3),
        "avoiding_share": round(swap.avoiding_ticks / swap.ticks, 3),
        "fallbacks": sum(swap.fallbacks.values()),
    }


def draw_swapping(result: Result[Swap], figure: Any) -> None:
    """Draw the tracks of the first seed from above, and the smallest distance over time of every flight."""
    figure.set_size_inches(13, 4.6)
    *above, over_time = figure.subplots(1, 3)
    for axes, case in zip(above, (ANTIPODES, RANDOM), strict=True):
        swap = next(iter(result.flown[case].values()))
        for number in range(swap.tracks_m.shape[1]):
            (line,) = axes.plot(*swap.tracks_m[:, number, :2].T, linewidth=1)
            axes.plot(*swap.tracks_m[0, number, :2], "o", color=line.get_color(), markersize=4)
            axes.plot(*swap.goals_m[number, :2], "s", color=line.get_color(), fillstyle="none")
        axes.set(aspect="equal", title=CASES[case][0], xlabel="x [m]", ylabel="y [m]")
    for case, (title, colour) in CASES.items():
        for number, swap in enumerate(result.flown[case].values()):
            label = None if number else title
            over_time.plot(swap.time_s, swap.nearest_m(), color=colour, label=label, linewidth=1)
    over_time.axhline(HARD_M, color="k", linestyle=":", label="hard distance")
    over_time.set_xlim(0.0, 6.0)
    over_time.set_ylim(bottom=0.0)
    over_time.set(xlabel="time since all vehicles left [s]", ylabel="smallest distance of two vehicles [m]")
    over_time.legend(fontsize="small")
    finish_figure(figure, f"Swapping places in conditions `{result.options.preset}`")


EXPERIMENT: Final = Experiment(
    "swapping",
    "Ten vehicles swap places without collision",
    {"laboratory": 5, "helicopters": 2},
    cases,
    figures,
    draw_swapping,
)
