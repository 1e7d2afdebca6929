"""The table of manoeuvres: what is flown, and what must be true of the flight.

The same table is acceptance test, demonstration and tutorial: `rcopterx fly NAME` flies a row of it.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from experiments.checks import Check, always, latency_checks
from ground_station.fleet import Fleet

Say = Callable[[str], None]
Wait = Callable[[float], None]


@dataclass(frozen=True)
class Manoeuvre:
    """One row of the table.

    Attributes
    ----------
    name, title
        For the command line and for reports.
    seconds
        About how long the recorded part takes.
    fly
        Flies it on a fleet that is in the air; waits through the given function.
    checks
        What must be true of the recorded flight.
    height_m
        Take-off height.
    """

    name: str
    title: str
    seconds: float
    fly: Callable[[Fleet, Say, Wait], None]
    checks: tuple[Check, ...]
    height_m: float = 1.0


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
    """First vehicle of a fleet that follows nobody."""
    return next(name for name, vehicle in fleet.file.vehicles.items() if not vehicle.follow)


def fly_paper_sequence(fleet: Fleet, say: Say, wait: Wait, turns: float = 0.0) -> None:
    """Set-point sequence of the paper; `turns` is added to the yaw set points [rad]."""
    leader = leader_of(fleet)
    for position_m, yaw_rad in PAPER_SET_POINTS:
        say(f"{leader}: set point {position_m} m, yaw {math.degrees(yaw_rad + turns):.0f} deg")
        fleet[leader].go_to(position_m, yaw_rad + turns)
        wait(PAPER_PERIOD_S)


def fly_paper_formation(fleet: Fleet, say: Say, wait: Wait) -> None:
    """The experiment of the paper's Fig. 3: set points of the leader, then other distances, then back."""
    fly_paper_sequence(fleet, say, wait)
    followers = {name: vehicle.follow[0] for name, vehicle in fleet.file.vehicles.items() if vehicle.follow}
    for name, link in followers.items():
        x, y, z = link.offset_m
        say(f"{name}: distance to {link.leader} grows by 0.2 m along x")
        fleet[name].follow(link.leader, (x - 0.2, y, z + 0.1))
    wait(PAPER_PERIOD_S)
    for name, link in followers.items():
        say(f"{name}: distance to {link.leader} as before")
        fleet[name].follow(link.leader, link.offset_m)
    wait(PAPER_PERIOD_S)


MANOEUVRES: Final = MappingProxyType(
    {
        row.name: row
        for row in (
            Manoeuvre(
                "paper-formation",
                "Set points, a yaw step of 540 degrees and changes of distance, as in the paper's Fig. 3",
                (len(PAPER_SET_POINTS) + 2) * PAPER_PERIOD_S,
                fly_paper_formation,
                (*always(), *latency_checks()),
            ),
            Manoeuvre(
                "hover",
                "Hover in formation for ten seconds",
                10.0,
                lambda _fleet, _say, wait: wait(10.0),
                (*always(), *latency_checks()),
            ),
        )
    }
)
"""Every manoeuvre by name."""


def sleep(seconds: float) -> None:
    """Wait in real time."""
    time.sleep(seconds)
