"""Hover of drawn vehicles whose subjects have their origin above or below the centre of gravity."""

from dataclasses import replace
from functools import partial
from itertools import product
from typing import Final

import numpy as np

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.plant import BodyPose
from rcopterx_studies.experiments.family import HOME_M, PROGRAMME, QUICK_PROGRAMME
from rcopterx_studies.experiments.knowledge import Knowledge, learn_around
from rcopterx_studies.experiments.rig import GUARDED, Progress, Rig
from rcopterx_studies.experiments.runner import Cases, Experiment, Options, median_and_worst
from rcopterx_studies.experiments.schemes import CASCADE

LEVER_ARMS_MM: Final = (-40, -20, 0, 20, 40)


def hover(
    knowledge: Knowledge, arm_mm: int, quick: bool, conditions: Conditions, seed: int,
    progress: Progress | None = None,
) -> float:  # fmt: skip
    """Return the root mean square error of the worse horizontal axis, of the centre of gravity [mm]."""
    conditions = replace(conditions, lever_arm_m=1e-3 * arm_mm)
    vehicle = replace(CASCADE, knowledge=knowledge).vehicle("h1", BodyPose(HOME_M), conditions, seed)
    rig, programme = Rig([vehicle], conditions, seed, GUARDED), QUICK_PROGRAMME if quick else PROGRAMME
    if knowledge == "learned":
        learn_around(rig, HOME_M, seed)
    begun_s = rig.time_s
    errors_m = rig.fly(programme.hover_s, progress=progress)["h1"].reference_error(
        begun_s + programme.settled_s
    )
    return 1e3 * float(np.sqrt(np.mean(np.square(errors_m[:, :2]), axis=0)).max())


def cases(options: Options) -> Cases[float]:
    """Every lever arm at every level of knowledge."""
    return {
        f"{level} / {arm_mm} mm": partial(hover, level, arm_mm, options.quick)
        for level, arm_mm in product(options.knowledge, LEVER_ARMS_MM)
    }


EXPERIMENT: Final = Experiment(
    "lever-arm",
    "Drawn vehicles hover, origins 4 cm below to 4 cm above the centre of gravity",
    {"helicopters": 10},
    cases,
    lambda _, flown: {"hover_mm": median_and_worst(list(flown.values()))},
    levels=("default", "learned"),
)
