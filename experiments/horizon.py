"""The paper's Fig. 2: computing time and tracking error against the length of the horizon."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.experiments.events import GoTo
from rcopterx.experiments.figures import finish_figure
from rcopterx.experiments.record import VehicleRecord
from rcopterx.experiments.rig import Progress, Rig
from rcopterx.experiments.runner import Options, Result, ShowProgress, fly_seeds
from rcopterx.experiments.schemes import CASCADE, PAPER, Scheme
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.state import YAW, Array

HORIZONS: Final = (10, 18, 30, 50, 80, 110)
QUICK_HORIZONS: Final = (10, 50)
HOVER_S: Final = 45.0
QUICK_HOVER_S: Final = 4.0
SET_POINT_S: Final = 4.0
SETTLED_S: Final = 4.0
WARM_S: Final = 0.2
"""Times count from here on: the first steps of a process load code."""
SET_POINTS: Final = (
    ((0.3, 0.0, 1.4), 0.0),
    ((0.3, 0.3, 1.4), 0.0),
    ((-0.5, 0.3, 1.4), 0.0),
    ((-0.5, 0.3, 1.0), 0.0),
    ((-0.5, 0.3, 1.0), 3 * math.pi),
)
YAW_WEIGHT_MM2_PER_RAD2: Final = (10.0 / 0.3) ** 2
"""0.3 rad weigh as much as 10 mm."""
SAMPLING_MS: Final = 20.0
SCHEMES: Final = (PAPER, CASCADE)


@dataclass(frozen=True)
class Flown:
    """One seed: processor times of the control steps while hovering [s], weighted squared errors [mm^2]."""

    step_s: Array
    squares_mm2: Array


def fly_horizon(
    scheme: Scheme,
    horizon: int,
    hover_s: float,
    conditions: Conditions,
    seed: int,
    progress: Progress | None = None,
) -> Flown:
    """Hover for the computing times, then fly the paper's set points for the errors."""
    vehicle = scheme.vehicle("h1", Pose((0.0, 0.0, 1.4)), conditions, seed, horizon)
    hover = Rig([vehicle], conditions, seed).fly(hover_s, progress=progress)["h1"]
    changes = [
        GoTo(SETTLED_S + index * SET_POINT_S, "h1", position_m, yaw_rad)
        for index, (position_m, yaw_rad) in enumerate(SET_POINTS)
    ]
    flown = Rig([vehicle], conditions, seed).fly(SETTLED_S + len(changes) * SET_POINT_S, changes)["h1"]
    return Flown(hover.step_s[hover.time_s >= WARM_S], weighted_squares_mm2(flown))


def weighted_squares_mm2(flown: VehicleRecord) -> Array:
    """Squared distance to the set point plus weighted squared yaw error, from the first set point on."""
    error = flown.reference_error(SETTLED_S)
    position = 1e6 * np.square(error[:, :YAW]).sum(axis=1)
    return np.asarray(position + YAW_WEIGHT_MM2_PER_RAD2 * np.square(error[:, YAW]))


def run(options: Options, show: ShowProgress) -> Result:
    """Fly every horizon with the paper's scheme and the cascade, in one process to measure their times.

    Returns
    -------
    Result
        Document: "horizons" -> N -> scheme -> figures.
    """
    horizons = QUICK_HORIZONS if options.quick else HORIZONS
    hover_s = QUICK_HOVER_S if options.quick else HOVER_S
    cases = {f"{scheme.name}, N = {horizon}": (scheme, horizon) for horizon in horizons for scheme in SCHEMES}
    flown = fly_seeds(
        {name: partial(fly_horizon, *case, hover_s) for name, case in cases.items()},
        replace(options, processes=1),
        show,
    )
    table: dict[str, dict[str, dict[str, float]]] = {str(horizon): {} for horizon in horizons}
    for name, (scheme, horizon) in cases.items():
        table[str(horizon)][scheme.name] = figures(list(flown[name].values()))
    return Result({"horizons": table}, partial(draw_horizon, table))


def figures(flights: Sequence[Flown]) -> dict[str, float]:
    """Figures of flights together."""
    step_ms = 1e3 * np.concatenate([flight.step_s for flight in flights])
    squares = np.concatenate([flight.squares_mm2 for flight in flights])
    return {
        "step_mean_ms": round(float(step_ms.mean()), 3),
        "step_p99_ms": round(float(np.percentile(step_ms, 99)), 3),
        "step_max_ms": round(float(step_ms.max()), 3),
        "weighted_error_mm2": round(float(squares.mean()), 1),
    }


def draw_horizon(table: Mapping[str, Mapping[str, Mapping[str, float]]], figure: Any) -> None:
    """Draw computing times on the left and tracking errors on the right, as in the paper's Fig. 2."""
    figure.set_size_inches(11, 4.5)
    left, right = figure.subplots(1, 2)
    lengths = [int(length) for length in table]
    for scheme, colour in zip(SCHEMES, ("tab:red", "tab:blue"), strict=True):
        rows = [table[str(length)][scheme.name] for length in lengths]
        left.plot(
            lengths, [row["step_mean_ms"] for row in rows], "s-", color=colour, label=f"{scheme.title}, mean"
        )
        left.plot(
            lengths, [row["step_max_ms"] for row in rows], "^:", color=colour, label=f"{scheme.title}, max"
        )
        right.plot(
            lengths, [row["weighted_error_mm2"] for row in rows], "s-", color=colour, label=scheme.title
        )
    left.axhline(SAMPLING_MS, color="grey", linestyle="--", label="sampling time")
    left.set_yscale("log")
    left.set_ylabel("whole control step [ms]")
    right.set_ylabel("weighted mean square error [mm²]")
    right.margins(y=0.3)
    right.set_ylim(bottom=0)
    for axes in (left, right):
        axes.set_xlabel("horizon N")
        axes.legend(fontsize="small")
    finish_figure(figure)
