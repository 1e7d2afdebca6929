"""The paper's Fig. 1: hovering flights of two minutes, mean square error per axis and yaw."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.experiments.knowledge import flies_helicopters
from rcopterx.experiments.rig import SETTLED_S, Progress, Rig
from rcopterx.experiments.runner import Options, Result, ShowProgress, fly_seeds
from rcopterx.experiments.schemes import ABLATIONS, CASCADE, HELICOPTER_SCHEMES, HORIZON, KUNZ, PAPER, Scheme
from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import Pose
from rcopterx.vehicles.state import YAW, Array

FLIGHT_S: Final = 120.0
HELICOPTER_FLIGHT_S: Final = 20.0
"""Drawn vehicles differ more than minutes do: many short flights say more than few long ones."""
QUICK_FLIGHT_S: Final = 15.0
PAPER_HORIZON: Final = 18
SET_POINT_M: Final = (0.0, 0.0, 1.0)
AXES: Final = ("x", "y", "z")


@dataclass(frozen=True)
class Setting:
    """A scheme with a horizon."""

    scheme: Scheme
    horizon: int


SETTINGS: Final[tuple[Setting, ...]] = (
    Setting(KUNZ, PAPER_HORIZON),
    Setting(PAPER, PAPER_HORIZON),
    Setting(CASCADE, PAPER_HORIZON),
    Setting(replace(CASCADE, name="cascade_50", title="Cascade, N = 50"), HORIZON),
)
"""[11] (no z integrator, no terminal cost), the paper's scheme and ours with N = 18; ours with N = 50."""
HELICOPTER_SETTINGS: Final = tuple(
    Setting(scheme, HORIZON) for scheme in (*HELICOPTER_SCHEMES.values(), *ABLATIONS.values())
)
"""On helicopters: every scheme, and the cascade without each of its parts."""


def settings_in(conditions: Conditions) -> tuple[Setting, ...]:
    """Settings that are flown in these conditions."""
    return HELICOPTER_SETTINGS if flies_helicopters(conditions) else SETTINGS


def fly_hover(
    setting: Setting, flight_s: float, conditions: Conditions, seed: int, progress: Progress | None = None
) -> Array:
    """Hover; returns true errors x, y, z [m], yaw [rad] in every settled control period, shape (K, 4)."""
    vehicle = setting.scheme.vehicle("h1", Pose(SET_POINT_M), conditions, seed, setting.horizon)
    rig = Rig([vehicle], conditions, seed)
    return rig.fly(flight_s, progress=progress)["h1"].reference_error(SETTLED_S)


def run(options: Options, show: ShowProgress) -> Result:
    """Fly every setting on every seed.

    Returns
    -------
    Result
        Document: setting -> axis -> root mean square and mean square; of helicopters also `vehicles`, the
        median and the worst vehicle.
    """
    drawn = flies_helicopters(options.conditions)
    flight_s = QUICK_FLIGHT_S if options.quick else HELICOPTER_FLIGHT_S if drawn else FLIGHT_S
    settings = settings_in(options.conditions)
    flown = fly_seeds(
        {setting.scheme.name: partial(fly_hover, setting, flight_s) for setting in settings}, options, show
    )
    document = {}
    for name, flights in flown.items():
        errors = list(flights.values())
        document[name] = figures(errors) | ({"vehicles": over_vehicles(errors)} if drawn else {})
    titles = {setting.scheme.name: setting.scheme.title for setting in settings}
    return Result(document, partial(draw_hover, document, titles, options.preset))


def figures(flights: Sequence[Array]) -> dict[str, dict[str, float]]:
    """Root mean squares and mean squares of flights together, in mm and rad."""
    square = np.mean(np.square(np.concatenate(flights)), axis=0)
    table = {
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


def over_vehicles(flights: Sequence[Array]) -> dict[str, float]:
    """Median and worst vehicle: root mean squares of the worse horizontal axis, of height, of yaw."""
    square = np.array([np.mean(np.square(errors), axis=0) for errors in flights])
    horizontal = 1e3 * np.sqrt(square[:, :2].max(axis=1))
    height, yaw = 1e3 * np.sqrt(square[:, 2]), 1e3 * np.sqrt(square[:, YAW])
    return {
        "median_mm": round(float(np.median(horizontal)), 1),
        "worst_mm": round(float(horizontal.max()), 1),
        "median_height_mm": round(float(np.median(height)), 1),
        "worst_height_mm": round(float(height.max()), 1),
        "median_yaw_mrad": round(float(np.median(yaw)), 1),
        "worst_yaw_mrad": round(float(yaw.max()), 1),
    }


def draw_hover(
    document: Mapping[str, Mapping[str, Mapping[str, float]]],
    titles: Mapping[str, str],
    preset: str,
    figure: Any,
) -> None:
    """Draw bars of the mean squares as in the paper's Fig. 1, on a logarithmic scale."""
    figure.set_size_inches(9, 4.5)
    left, right = figure.subplots(1, 2, width_ratios=(3, 1))
    width = 0.8 / len(document)
    for index, (name, table) in enumerate(document.items()):
        shift = (index - (len(document) - 1) / 2) * width
        places = np.arange(len(AXES)) + shift
        left.bar(places, [table[axis]["mean_square_mm2"] for axis in AXES], width, label=titles[name])
        right.bar([shift], [table["yaw"]["mean_square_rad2"]], width)
    left.set_xticks(np.arange(len(AXES)), AXES)
    right.set_xticks([0.0], ["psi"])
    left.set_ylabel("mean square error [mm²]")
    right.set_ylabel("mean square error [rad²]")
    for axes in (left, right):
        axes.set_yscale("log")
        axes.grid(axis="y", alpha=0.3)
    left.legend(fontsize="small")
    figure.suptitle(f"Hovering in conditions `{preset}`")
    figure.tight_layout()
