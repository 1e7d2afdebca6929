"""The tasks of the arena, one row each: vehicles, what they do, and what makes it hard.

Headings stay zero and offsets are those of the inertial frame. Vehicles hover at their places at the start.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from rcopterx.bus.messages import LeaderLink
from rcopterx.control.references.path_shapes import figure_eight
from rcopterx.vehicles.tuples import Three
from rcopterx_studies.experiments.events import FlyEvent, FollowEvent, GoToEvent, LeadEvent, PilotEvent
from rcopterx_studies.experiments.formation import LINE, WIDE
from rcopterx_studies.experiments.network import LinkQuality
from rcopterx_studies.experiments.rig import RigOptions

HEAD: Final = "h1"
SETTLED_S: Final = 4.0  # from here on errors usually count
CROSSED_S: Final = 13.0
ROW_M: Final = 0.6
COLUMN_M: Final = 0.7
CIRCLE_M: Final = 1.3
START_M: Final[Three] = (0.6, 0.0, 1.2)


@dataclass(frozen=True)
class ArenaTask:
    """One row."""

    name: str
    title: str
    starts_m: Mapping[str, Three]  # where the vehicles hover at first, by name
    links: Mapping[str, tuple[LeaderLink, ...]]  # leaders of the vehicles that have any
    events: tuple[PilotEvent, ...]
    duration_s: float
    options: RigOptions = field(default_factory=RigOptions)
    turbulence: float = 1.0  # factor of the turbulence of the conditions
    errors_from_s: float = SETTLED_S  # time from which errors count


def link(offset_m: Three, leader: str = HEAD) -> tuple[LeaderLink, ...]:
    """One leader."""
    return (LeaderLink(leader=leader, offset_m=offset_m),)


def wedge(count: int) -> tuple[dict[str, Three], dict[str, tuple[LeaderLink, ...]]]:
    """Start places and leaders of a wedge: each row has a vehicle more, and follows the row before it."""
    places: list[tuple[int, int]] = [(row, column) for row in range(count) for column in range(row + 1)]
    names = {place: f"h{number}" for number, place in enumerate(places[:count], 1)}
    starts: dict[str, Three] = {}
    links = {}
    for (row, column), name in names.items():
        y_m = COLUMN_M * (column - row / 2)
        starts[name] = (START_M[0] - ROW_M * row, START_M[1] + y_m, START_M[2])
        if row:
            above = (row - 1, min(column, row - 1))
            beside_m = COLUMN_M * (0.5 if column == row else -0.5)
            links[name] = link((-ROW_M, beside_m, 0.0), names[above])
    return starts, links


def _task(name: str, title: str, count: int, events: Sequence[PilotEvent], duration_s: float) -> ArenaTask:
    starts, links = wedge(count)
    return ArenaTask(name, title, starts, links, tuple(events), duration_s)


def _moves(*steps_m: tuple[float, Three]) -> list[PilotEvent]:
    """Set points of the head relative to its start, at some times."""
    x, y, z = START_M
    return [GoToEvent(time_s, HEAD, (x + dx, y + dy, z + dz)) for time_s, (dx, dy, dz) in steps_m]


def _crossing(count: int) -> ArenaTask:
    """Vehicles on a circle change places with those opposite, all at the same height."""
    angles = [math.tau * number / count for number in range(count)]
    places: list[Three] = [(CIRCLE_M * math.cos(a), CIRCLE_M * math.sin(a), START_M[2]) for a in angles]
    starts = {f"h{number}": place for number, place in enumerate(places, 1)}
    events = [GoToEvent(SETTLED_S, name, (-x, -y, z)) for name, (x, y, z) in starts.items()]
    title = f"crossing of {count}: opposite vehicles change places"
    options = RigOptions(avoid=True)
    return ArenaTask(
        "crossing", title, starts, {}, tuple(events), CROSSED_S + 1.0, options, errors_from_s=CROSSED_S
    )


MOVES: Final = _moves((4.5, (0.6, 0.3, 0.2)), (7.5, (0.2, 0.0, 0.0)))
PAPER: Final = _moves(
    (5.0, (0.3, 0.3, 0.2)), (13.0, (-0.5, 0.3, 0.2)), (17.0, (-0.5, 0.3, -0.2)), (25.0, (0.0, -0.3, 0.0))
)
THREE: Final = _task("three", "3 vehicles, two set points of the head", 3, MOVES, 10.0)
FIVE: Final = _task("five", "", 5, MOVES, 10.0)
EIGHT_PATH: Final = figure_eight(START_M, (0.7, 0.4), 8.0)
FAR: Final = {name: (x, -y, z) for name, (x, y, z) in WIDE.items()}  # on the sides that wedges have


def _slots(shape: Mapping[str, Three], time_s: float) -> list[FollowEvent]:
    return [FollowEvent(time_s, name, link(offset_m)) for name, offset_m in shape.items()]


def _led_by_second() -> list[PilotEvent]:
    """h2 takes the lead of three while all keep their places, and goes to set points."""
    x, y, z = (a - b for a, b in zip(THREE.starts_m["h2"], START_M, strict=True))
    change_s, place = 5.0, THREE.starts_m["h2"]
    return [
        LeadEvent(change_s, "h2"),
        FollowEvent(change_s, HEAD, link((-x, -y, -z), "h2")),
        FollowEvent(change_s, "h3", link((0.0, -2.0 * y, 0.0), "h2")),
        *(
            GoToEvent(time_s, "h2", (place[0] + ahead_m, place[1], place[2]))
            for time_s, ahead_m in ((7.5, 0.6), (10.5, 0.0))
        ),
    ]


def _row() -> list[PilotEvent]:
    """Five vehicles form a row side by side, then a wedge again."""
    beside: dict[str, Three] = {
        "h2": (0.0, -0.7, 0.0), "h3": (0.0, 0.7, 0.0), "h4": (0.0, -0.7, 0.0), "h5": (0.0, 0.7, 0.0)
    }  # fmt: skip
    leaders = {"h2": HEAD, "h3": HEAD, "h4": "h2", "h5": "h3"}
    there = [FollowEvent(4.5, name, link(offset_m, leaders[name])) for name, offset_m in beside.items()]
    back = [FollowEvent(9.0, name, FIVE.links[name]) for name in FIVE.links]
    return [*there, *back]


def _five(name: str, what: str, **changes: Any) -> ArenaTask:
    """A task of five vehicles, two set points of the head unless the events change."""
    return replace(FIVE, name=name, title=f"5 vehicles{what}", **changes)


_FORMATION: Final = replace(
    THREE,
    name="formation",
    title="the paper's formation: set points and distances in turns",
    events=(*PAPER, *_slots(FAR, 9.0), *_slots(LINE, 21.0)),
    duration_s=29.0,
)
_ROWS: Final = (
    _FORMATION,
    replace(_FORMATION, name="third", title="the same in a third of the turbulence", turbulence=1.0 / 3.0),
    replace(_FORMATION, name="still", title="the same in still air", turbulence=0.0),
    _five("geometry", " change to a row and back", events=tuple(_row()), duration_s=14.0),
    replace(
        THREE,
        name="leader",
        title="another vehicle takes the lead",
        events=tuple(_led_by_second()),
        duration_s=14.0,
    ),
    _five(
        "figure_eight",
        " fly a figure-eight of 8 s",
        events=(FlyEvent(SETTLED_S, HEAD, EIGHT_PATH),),
        duration_s=13.5,
    ),
    _crossing(8),
    _five("gusts", ", turbulence three times as strong", turbulence=3.0),
    *(
        _five(
            f"loss_{percent}",
            f", {percent} % of the messages lost",
            options=RigOptions(LinkQuality(loss=percent / 100)),
        )
        for percent in (5, 20, 50)
    ),
    *(
        _five(f"delay_{ms}", f", messages {ms} ms late", options=RigOptions(LinkQuality(delay_s=ms / 1000)))
        for ms in (20, 60, 100)
    ),
    _five(
        "killed",
        ", the agent of a leader among them does not run for a second",
        options=RigOptions(killed={"h2": (5.5, 6.5)}),
    ),
    _five(
        "slow",
        ", the agent of a leader among them computes every third period only",
        options=RigOptions(slow={"h2": 3}),
    ),
    _task("hover", "3 vehicles hover", 3, (), 20.0),
    THREE,
    _task("eight", "8 vehicles, two set points of the head", 8, MOVES, 10.0),
    _task("twenty", "20 vehicles, two set points of the head", 20, MOVES, 10.0),
)
TASKS: Final[Mapping[str, ArenaTask]] = {task.name: task for task in _ROWS}  # tasks by name


def quick(task: ArenaTask) -> ArenaTask:
    """The beginning of a task."""
    return replace(task, duration_s=min(task.duration_s, 2.0 * SETTLED_S))
