"""Manoeuvres with crossing paths."""

from typing import Final

import numpy as np

from rcopterx.experiments import steps
from rcopterx.experiments.checks import avoided, controlled, distance_kept, ends_at, transmitters_undisturbed
from rcopterx.experiments.manoeuvre import Manoeuvre
from rcopterx.experiments.steps import in_order, pause
from rcopterx.vehicles.tuples import Three

RADIUS_M: Final = 0.8
FIVE: Final = ("h1", "h2", "h3", "h4", "h5")


def on_circle(turn_deg: float) -> dict[str, Three]:
    """Places of five vehicles on a circle a metre above the floor, turned by an angle."""
    found = {}
    for number, name in enumerate(FIVE):
        angle = 2 * np.pi * number / len(FIVE) + np.radians(turn_deg)
        x, y = (RADIUS_M * np.array([np.cos(angle), np.sin(angle)])).round(3).tolist()
        found[name] = (x, y, 1.0)
    return found


CROSSING_ROWS: Final = (
    Manoeuvre(
        "place-swapping",
        "Five vehicles on a circle are sent across it at the same moment, and back again",
        14.0,
        in_order(
            *(steps.lead(name) for name in FIVE[1:]),
            steps.go_together(on_circle(72.0)), pause(1.0),
            steps.go_together(on_circle(252.0)), pause(1.0),
            steps.go_together(on_circle(72.0)), pause(1.0),
        ),
        (
            *controlled(), distance_kept(), avoided(), transmitters_undisturbed(),
            *(ends_at(name, place) for name, place in on_circle(72.0).items()),
        ),
        fleet="quintet",
    ),
)  # fmt: skip
