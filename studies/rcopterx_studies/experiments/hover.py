"""The paper's Fig. 1: hovering flights of two minutes, mean square error per axis and yaw."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose
from rcopterx.vehicles.state import YAW, Array
from rcopterx_studies.experiments.rig import SETTLED_S, Progress, Rig
from rcopterx_studies.experiments.runner import Cases, Experiment, FlightResult, Options
from rcopterx_studies.experiments.schemes import CASCADE, KUNZ, PAPER, FlownScheme
from rcopterx_studies.figures import finish_figure

FLIGHT_S: Final = 120.0
QUICK_FLIGHT_S: Final = 15.0
PAPER_HORIZON: Final = 18
SET_POINT_M: Final = (0.0, 0.0, 1.0)
AXES: Final = ("x", "y", "z")

SCHEMES: Final = (
    *(replace(scheme, horizon=PAPER_HORIZON) for scheme in (KUNZ, PAPER, CASCADE)),
    replace(CASCADE, name="cascade_50", title="Cascade, N = 50"),
)
"""[11] (no z integrator, no terminal cost), the paper's scheme and ours with N = 18; ours with N = 50."""


def fly_hover(
    scheme: FlownScheme, flight_s: float, conditions: Conditions, seed: int, progress: Progress | None = None
) -> Array:
    """Hover; returns true errors x, y, z [m], yaw [rad] in every settled control period, shape (K, 4)."""
    vehicle = scheme.vehicle("h1", BodyPose(SET_POINT_M), conditions, seed)
    rig = Rig([vehicle], conditions, seed)
    return rig.fly(flight_s, progress=progress)["h1"].reference_error(SETTLED_S)


def cases(options: Options) -> Cases[Array]:
    """Every scheme."""
    flight_s = QUICK_FLIGHT_S if options.quick else FLIGHT_S
    return {scheme.name: partial(fly_hover, scheme, flight_s) for scheme in SCHEMES}


def figures(_: str, flights: Mapping[int, Array]) -> dict[str, Any]:
    """Root mean squares and mean squares of flights together, in mm and rad."""
    square = np.mean(np.square(np.concatenate(list(flights.values()))), axis=0)
    table: dict[str, Any] = {
        axis: {
            "rms_mm": round(1e3 * float(np.sqrt(square[index])), 3),
            "mean_square_mm2": round(1e6 * float(square[index]), 3),
        }
        for index, axis in enumerate(AXES)
    }
    table["yaw"] = {
        "rms_rad": round(float(np.sqrt(square[YAW])), 6),
        "mean_square_rad2": round(float(square[YAW]), 9),
    }
    return table


def draw_hover(result: FlightResult[Array], figure: Any) -> None:
    """Draw bars of the mean squares as in the paper's Fig. 1, on a logarithmic scale."""
    figure.set_size_inches(9, 4.5)
    left, right = figure.subplots(1, 2, width_ratios=(3, 1))
    width = 0.8 / len(SCHEMES)
    for index, scheme in enumerate(SCHEMES):
        table = result.document[scheme.name]
        shift = (index - (len(SCHEMES) - 1) / 2) * width
        places = np.arange(len(AXES)) + shift
        squares = [table[axis]["mean_square_mm2"] for axis in AXES]
        left.bar(places, squares, width, label=scheme.title)
        right.bar([shift], [table["yaw"]["mean_square_rad2"]], width)
    left.set_xticks(np.arange(len(AXES)), AXES)
    right.set_xticks([0.0], ["psi"])
    left.set(ylabel="mean square error [mm²]", yscale="log")
    right.set(ylabel="mean square error [rad²]", yscale="log")
    left.legend(fontsize="small")
    finish_figure(figure, f"Hovering in conditions `{result.options.preset}`", "y")


EXPERIMENT: Final = Experiment(
    "hover",
    "Fig. 1: hovering errors of [11], the paper and the cascade",
    {"laboratory": 3},
    cases,
    figures,
    draw_hover,
)
