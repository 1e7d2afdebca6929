"""The tasks of the arena, one row each: vehicles, what they do, and what makes it hard.

Headings stay zero and offsets are those of the inertial frame. Vehicles hover at their places at the start.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import msgspec

from rcopterx.bus.messages import LeaderLink
from rcopterx.control.references.path_shapes import figure_eight
from rcopterx.tables import table_beside
from rcopterx.vehicles.tuples import Three
from rcopterx_studies.experiments.events import FlyEvent, FollowEvent, GoToEvent, LeadEvent, PilotEvent
from rcopterx_studies.experiments.rig import RigOptions

HEAD: Final = "h1"
SETTLED_S: Final = 4.0  # from here on errors usually count
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


def _circle(count: int) -> dict[str, Three]:
    """Start places of vehicles on a circle, all at the same height."""
    angles = [math.tau * number / count for number in range(count)]
    places: list[Three] = [(CIRCLE_M * math.cos(a), CIRCLE_M * math.sin(a), START_M[2]) for a in angles]
    return {f"h{number}": place for number, place in enumerate(places, 1)}


def _event(starts: Mapping[str, Three], time_s: float, vehicle: str, does: str, *words: Any) -> PilotEvent:
    match does, words:
        case "go_by", [by_m]:
            x, y, z = (start + by for start, by in zip(starts[vehicle], by_m, strict=True))
            return GoToEvent(time_s, vehicle, (x, y, z))
        case "follow", [leader, [x, y, z]]:
            return FollowEvent(time_s, vehicle, link((x, y, z), leader))
        case "figure_eight", [[length_m, width_m], period_s]:
            return FlyEvent(time_s, vehicle, figure_eight(starts[vehicle], (length_m, width_m), period_s))
        case "lead", []:
            return LeadEvent(time_s, vehicle)
    raise ValueError(f"{does}: no event of this name with {len(words)} arguments")


def _row(name: str) -> dict[str, Any]:
    """Row of a task, with what it leaves out from that named by `like`."""
    row = dict(_TABLE[name])
    return _row(row.pop("like")) | row if "like" in row else row


def _task(name: str, row: dict[str, Any]) -> ArenaTask:
    links: Mapping[str, tuple[LeaderLink, ...]] = {}
    if "circle" in row:
        starts = _circle(row.pop("circle"))
        events: list[PilotEvent] = [
            GoToEvent(SETTLED_S, one, (-x, -y, z)) for one, (x, y, z) in starts.items()
        ]
    else:
        starts, links = wedge(row.pop("wedge"))
        events = [_event(starts, *words) for words in row.pop("events", ())]
    options = msgspec.convert(row.pop("options", {}), RigOptions)
    return ArenaTask(name, starts_m=starts, links=links, events=tuple(events), options=options, **row)


_TABLE: Final = table_beside(__file__, "tasks")
TASKS: Final[Mapping[str, ArenaTask]] = {name: _task(name, _row(name)) for name in _TABLE}  # tasks by name


def quick(task: ArenaTask) -> ArenaTask:
    """The beginning of a task."""
    return replace(task, duration_s=min(task.duration_s, 2.0 * SETTLED_S))
