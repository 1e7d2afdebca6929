"""The paper's Fig. 2: computing time and tracking error against the length of the horizon."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.experiments.events import GoTo
from rcopterx.experiments.figures import finish_figure
from rcopterx.experiments.record import VehicleRecord
from rcopterx.experiments.rig import Progress, Rig
from rcopterx.experiments.runner import Cases, Experiment, Options, Result
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


def cases(options: Options) -> Cases[Flown]:
    """Every horizon with the paper's scheme and the cascade."""
    hover_s = QUICK_HOVER_S if options.quick else HOVER_S
    return {
        f"{horizon} / {scheme.name}": partial(fly_horizon, scheme, horizon, hover_s)
        for horizon in (QUICK_HORIZONS if options.quick else HORIZONS)
        for scheme in SCHEMES
    }


def figures(_: str, flights: Mapping[int, Flown]) -> dict[str, float]:
    """Computing times and errors of flights together."""
    step_ms = 1e3 * np.concatenate([flight.step_s for flight in flights.values()])
    squares = np.concatenate([flight.squares_mm2 for flight in flights.values()])
    return {
        "step_mean_ms": round(float(step_ms.mean()), 3),
        "step_p99_ms": round(float(np.percentile(step_ms, 99)), 3),
        "step_max_ms": round(float(step_ms.max()), 3),
        "weighted_error_mm2": round(float(squares.mean()), 1),
    }


def draw_horizon(result: Result[Flown], figure: Any) -> None:
    """Draw computing times on the left and tracking errors on the right, as in the paper's Fig. 2."""
    figure.set_size_inches(11, 4.5)
    left, right = figure.subplots(1, 2)
    lengths = [int(length) for length in result.document]
    for scheme, colour in zip(SCHEMES, ("tab:red", "tab:blue"), strict=True):
        rows = [table[scheme.name] for table in result.document.values()]
        for axes, name, style, what in (
            (left, "step_mean_ms", "s-", ", mean"),
            (left, "step_max_ms", "^:", ", max"),
            (right, "weighted_error_mm2", "s-", ""),
        ):
            values = [row[name] for row in rows]
            axes.plot(lengths, values, style, color=colour, label=scheme.title + what)
    left.axhline(SAMPLING_MS, color="grey", linestyle="--", label="sampling time")
    left.set(ylabel="whole control step [ms]", yscale="log")
    right.margins(y=0.3)
    right.set(ylabel="weighted mean square error [mm²]")
    right.set_ylim(bottom=0)
    for axes in (left, right):
        axes.set_xlabel("horizon N")
        axes.legend(fontsize="small")
    finish_figure(figure)


EXPERIMENT: Final = Experiment(
    "horizon",
    "Fig. 2: computing time and tracking error against the horizon",
    {"laboratory": 3},
    cases,
    figures,
    draw_horizon,
    timed=True,
)
