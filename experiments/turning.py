"""Yaw steps of a leader whose followers' offsets turn with its heading: errors against the arms' length.

A leader and two followers at the ends of equal arms, behind and to the left in its heading frame. The heading
makes steps, at last together with the position; errors are the followers' distances from their places.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.experiments.chain import vehicles
from rcopterx.experiments.events import Event, GoTo
from rcopterx.experiments.record import rms_and_max_mm
from rcopterx.experiments.rig import Progress, Rig
from rcopterx.experiments.runner import Cases, Experiment, Options
from rcopterx.experiments.schemes import HORIZON
from rcopterx.simulator.conditions import Conditions
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
    steps: Sequence[str],
    quick: bool,
    conditions: Conditions,
    seed: int,
    progress: Progress | None = None,
) -> dict[str, Array]:
    """Fly the steps; returns the errors of both followers after each of them [m]."""
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


def cases(options: Options) -> Cases[dict[str, Array]]:
    """Every arm."""
    arms, steps = (ARMS_M[1:2], tuple(STEPS)[:1]) if options.quick else (ARMS_M, tuple(STEPS))
    return {f"{arm_m:g} m": partial(fly_steps, arm_m, steps, options.quick) for arm_m in arms}


def figures(_: str, flights: Mapping[int, Mapping[str, Array]]) -> dict[str, dict[str, float]]:
    """Errors after each step, flights together."""
    return {
        step: rms_and_max_mm(np.concatenate([errors[step] for errors in flights.values()]))
        for step in next(iter(flights.values()))
    }


EXPERIMENT: Final = Experiment(
    "turning",
    "Yaw steps of a leader whose followers turn with it",
    {"laboratory": 3},
    cases,
    figures,
    beside_ideal=True,
)
