"""Yaw steps of a leader whose followers' offsets turn with its heading: what arms of a length cost.

A leader and two followers at the ends of equal arms, behind and to the left in its heading frame. The heading
makes steps, at last together with the position; errors are the followers' distances from their places.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.experiments.chain import vehicles
from rcopterx.experiments.events import Event, GoTo
from rcopterx.experiments.record import rms
from rcopterx.experiments.rig import Progress, Rig
from rcopterx.experiments.runner import Options, Result, Tell, Work, run_all
from rcopterx.experiments.schemes import HORIZON
from rcopterx.simulator.conditions import PRESETS, Conditions
from rcopterx.vehicles.state import Array

ARMS_M: Final = (0.35, 0.64, 0.9)
SLOT_S: Final = 10.0
QUICK_HORIZON: Final = 20
HEAD: Final = "h1"
STEPS: Final = {
    "90 deg": ((0.0, 0.0, 1.0), math.radians(90)),
    "180 deg": ((0.0, 0.0, 1.0), math.radians(-90)),
    "90 deg and 0.5 m": ((0.2, -0.45, 1.0), 0.0),
}
"""Set points of the leader, one after the other: position [m] and yaw [rad]."""


def links_with(arm_m: float) -> dict[str, tuple[LeaderLink, ...]]:
    """A leader, and two followers that turn with it."""
    return {
        HEAD: (),
        "h2": (LeaderLink(leader=HEAD, offset_m=(-arm_m, 0.0, 0.0), frame="heading"),),
        "h3": (LeaderLink(leader=HEAD, offset_m=(0.0, arm_m, 0.0), frame="heading"),),
    }


def fly_steps(
    arm_m: float,
    conditions: Conditions,
    seed: int,
    steps: Sequence[str],
    quick: bool,
    progress: Progress | None = None,
) -> dict[str, Array]:
    """Fly the steps.

    Returns
    -------
    dict
        By step the errors of both followers from then on [m].
    """
    # The leader of a formation of the chain experiment starts elsewhere; it has a slot to come here.
    events: list[Event] = [GoTo(0.0, HEAD, (0.0, 0.0, 1.0), 0.0)]
    events += [GoTo(SLOT_S * number, HEAD, *STEPS[name]) for number, name in enumerate(steps, 1)]
    rig = Rig(
        vehicles(links_with(arm_m), conditions, seed, QUICK_HORIZON if quick else HORIZON), conditions, seed
    )
    record = rig.fly(SLOT_S * (len(steps) + 1), events, progress)
    per_slot = round(SLOT_S / 0.02)
    errors = [record[name].formation_error_m() for name in ("h2", "h3")]
    return {
        name: np.concatenate([error[number * per_slot : (number + 1) * per_slot] for error in errors])
        for number, name in enumerate(steps, 1)
    }


def run(options: Options, tell: Tell) -> Result:
    """Fly with every arm: once in ideal conditions, and on every seed in those of the laboratory.

    Returns
    -------
    Result
        Document: condition -> arm -> step -> root mean square and largest error.
    """
    arms, steps = (ARMS_M[1:2], tuple(STEPS)[:1]) if options.quick else (ARMS_M, tuple(STEPS))
    cases = [
        (condition, arm_m, seed)
        for condition, seeds in options.beside_ideal.items()
        for arm_m in arms
        for seed in seeds
    ]
    works = [
        Work(
            f"{arm_m:g} m, {condition}, seed {seed}",
            partial(fly_steps, arm_m, PRESETS[condition], seed, steps, options.quick),
        )
        for condition, arm_m, seed in cases
    ]
    flights = run_all(works, options, tell)
    document: dict[str, dict[str, dict[str, dict[str, float]]]] = {}
    for condition in options.beside_ideal:
        document[condition] = {}
        for arm_m in arms:
            flown = [
                flight
                for (own, arm, _), flight in zip(cases, flights, strict=True)
                if (own, arm) == (condition, arm_m)
            ]
            document[condition][f"{arm_m:g} m"] = {
                step: figures(np.concatenate([errors[step] for errors in flown])) for step in steps
            }
    return Result(document, partial(draw_turning, document))


def figures(errors_m: Array) -> dict[str, float]:
    """Root mean square and largest error [mm]."""
    return {"rms_mm": round(1000 * rms(errors_m), 2), "max_mm": round(1000 * float(errors_m.max()), 2)}


def draw_turning(document: dict[str, Any], figure: Any) -> None:
    """Draw the largest errors against the arm.

    Parameters
    ----------
    document
        As `run` returns it.
    figure
        Empty `matplotlib.figure.Figure`.
    """
    figure.set_size_inches(8, 4)
    panels = figure.subplots(1, len(document), sharey=True, squeeze=False)[0]
    for axes, (condition, table) in zip(panels, document.items(), strict=True):
        arms = list(table)
        for step in table[arms[0]]:
            axes.plot(arms, [table[arm][step]["max_mm"] for arm in arms], "o-", label=step)
        axes.set_title(condition)
        axes.set_xlabel("arm")
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    figure.axes[0].set_ylabel("largest distance from the place [mm]")
    figure.axes[0].set_ylim(bottom=0.0)
    figure.suptitle("Followers that turn with their leader, while it turns")
    figure.tight_layout()
