"""The paper's sequence of set points, apart from other manoeuvres so that `rcopterx demo` imports little."""

import math
from collections.abc import Callable
from typing import Final

from rcopterx.ground_station.scripting.fleet import Fleet

Say = Callable[[str], None]
Wait = Callable[[float], None]

PAPER_PERIOD_S: Final = 4.0
PAPER_SET_POINTS: Final = (
    ((0.3, 0.0, 1.4), 0.0),
    ((0.3, 0.3, 1.4), 0.0),
    ((-0.5, 0.3, 1.4), 0.0),
    ((-0.5, 0.3, 1.0), 0.0),
    ((-0.5, 0.3, 1.0), 3 * math.pi),
    ((0.0, 0.0, 1.0), 3 * math.pi),
)
"""Set points of the paper's Fig. 2 every 4 s, and back to the middle."""


def leader_of(fleet: Fleet) -> str:
    """First vehicle of a fleet without leaders."""
    return next(name for name, vehicle in fleet.file.vehicles.items() if not vehicle.follow)


def fly_paper_sequence(fleet: Fleet, say: Say, wait: Wait, turns: float = 0.0) -> None:
    """Fly the set points of the paper; `turns` is added to the yaw set points [rad]."""
    leader = leader_of(fleet)
    for position_m, yaw_rad in PAPER_SET_POINTS:
        say(f"{leader}: set point {position_m} m, yaw {math.degrees(yaw_rad + turns):.0f} deg")
        fleet[leader].go_to(position_m, yaw_rad + turns)
        wait(PAPER_PERIOD_S)
