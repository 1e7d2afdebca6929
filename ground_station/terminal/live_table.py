"""The live table of a fleet in a terminal: as many columns as its width has room for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rich.console import Group
from rich.table import Table
from rich.text import Text

from rcopterx.ground_station.report.latency import STAGES, TOTAL
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.state import VehicleState

GAP = 2
"""Blanks between two columns."""
UNKNOWN = "-"
FIGURES = ("p50", "p99", "max")
LATENCY = "latency"
"""Name of all latency columns together, for `--columns`."""


@dataclass(frozen=True)
class Column:
    """A column of the table; `name` is for `--columns`, `cell` gives its text for a vehicle."""

    name: str
    heading: str
    cell: Callable[[VehicleState], Text | str]
    rank: int
    """Columns of a lower rank are shown first where there is no room for all."""
    width: int
    """Usual width of its cells, so that columns do not come and go with every figure."""
    right: bool = False
    wraps: bool = False

    def needed(self, states: Sequence[VehicleState]) -> int:
        """Width of the column for these vehicles."""
        cells = () if self.wraps else (str(self.cell(state)) for state in states)
        return max(self.width, *map(len, (*self.heading.split("\n"), *cells)))


def columns_named(names: Sequence[str]) -> tuple[Column, ...]:
    """Columns by name, the vehicle first; `latency` stands for all stages. Raises ValueError."""
    known = {column.name: (column,) for column in COLUMNS} | {LATENCY: LATENCY_COLUMNS}
    for name in names:
        if name not in known:
            raise ValueError(f"no column {name!r}, known are {', '.join(known)}")
    return (COLUMNS[0], *(column for name in names if name != COLUMNS[0].name for column in known[name]))


def pages(states: Sequence[VehicleState], width: int) -> list[tuple[Column, ...]]:
    """Distribute all columns over as many pages as a terminal of `width` characters needs.

    The most important columns are on the first page; each page begins with the vehicle.
    """
    first, *others = COLUMNS
    waiting = sorted(others, key=lambda column: column.rank)
    found: list[tuple[Column, ...]] = []
    while waiting:
        room = width - first.needed(states)
        page: list[Column] = []
        for column in waiting:
            needed = GAP + column.needed(states)
            # At least one column per page, however narrow the terminal is.
            if needed <= room or not page:
                page.append(column)
                room -= needed
        waiting = [column for column in waiting if column not in page]
        found.append((first, *(column for column in others if column in page)))
    return found


def fleet_table(fleet: Fleet, width: int) -> Table:
    """All vehicles of a running fleet, in the most important columns that fit."""
    states = [vehicle.state for vehicle in fleet]
    return _table(fleet, states, pages(states, width)[0])


def fleet_view(
    fleet: Fleet, width: int, page: int = 0, columns: Sequence[Column] | None = None, keys: bool = False
) -> Group:
    """The table, and below it problems that block take-off, and notes.

    `columns` replaces the pages of columns that fit into `width`; `keys` adds a line about the keyboard.
    Pages begin again after the last one.
    """
    states = [vehicle.state for vehicle in fleet]
    shown = pages(states, width) if columns is None else [tuple(columns)]
    lines = [Text(line, style="red") for line in fleet.problems()]
    lines += [Text(f"note: {line}", style="dim") for line in fleet.notes()]
    if keys:
        more = f"columns {page % len(shown) + 1} of {len(shown)}, Tab: others; " if len(shown) > 1 else ""
        lines.append(Text(f"{more}q: quit", style="dim"))
    return Group(_table(fleet, states, shown[page % len(shown)]), *lines)


def _table(fleet: Fleet, states: Sequence[VehicleState], columns: Sequence[Column]) -> Table:
    table = Table(
        title=Text(tracker_line(fleet)),
        title_justify="left",
        box=None,
        padding=(0, GAP, 0, 0),
        pad_edge=False,
    )
    for column in columns:
        table.add_column(
            Text(column.heading),
            no_wrap=not column.wraps,
            overflow="fold",
            justify="right" if column.right else "left",
            min_width=column.needed(states),
        )
    for state in states:
        # Texts from the bus are shown as they are, whatever brackets they contain.
        table.add_row(*(column.cell(state) for column in columns))
    return table


def table_width(fleet: Fleet, columns: Sequence[Column]) -> int:
    """Width that a terminal needs for a table."""
    states = [vehicle.state for vehicle in fleet]
    return sum(column.needed(states) + GAP for column in columns)


def tracker_line(fleet: Fleet) -> str:
    """Name of the fleet and state of its motion capture."""
    received = fleet.tracker.latest()
    if received is None:
        return f"{fleet.file.name}: Vicon gateway not responding yet"
    status = received.message
    if status.state != "up":
        return f"{fleet.file.name}: Tracker {status.trying}"
    rate = 1 / status.period_s if status.period_s else 0.0
    return f"{fleet.file.name}: Tracker {status.address}, frame {status.frame}, {rate:.0f} Hz"


def _phase(state: VehicleState) -> Text:
    if state.silent:
        return Text(f"{state.phase} (silent)", style="red")
    return Text(state.phase, style="green" if state.phase == "flying" else "")


def _arbiter(state: VehicleState) -> str:
    return UNKNOWN if state.transmitter is None else state.transmitter.state


def _flown_by(state: VehicleState) -> Text:
    factor = 1.0 if state.agent is None else state.agent.diagnostics.effort_factor
    return Text((state.flown_by or UNKNOWN) + ("" if factor == 1.0 else f", effort x {factor:g}"))


def _position(state: VehicleState) -> str:
    position = state.position_m
    return UNKNOWN if position is None else " ".join(f"{value:5.2f}" for value in position)


def _seen(state: VehicleState) -> str:
    own = None if state.agent is None else state.agent.diagnostics.pose_age_s
    return _milliseconds(own if state.seen_age_s is None else state.seen_age_s)


def _solve(state: VehicleState) -> str:
    if state.agent is None:
        return UNKNOWN
    return f"{state.agent.diagnostics.solve_ms_p50:.2f} / {state.agent.diagnostics.solve_ms_p99:.2f}"


def _stage(stage: str) -> Callable[[VehicleState], str]:
    def cell(state: VehicleState) -> str:
        figures = state.latency_ms.get(stage)
        return UNKNOWN if figures is None else " ".join(f"{figures[name]:.1f}" for name in FIGURES)

    return cell


def _events(state: VehicleState) -> Text:
    return Text(", ".join(f"{kind} {count}" for kind, count in state.event_counts.items()) or UNKNOWN)


def _milliseconds(value_s: float | None) -> str:
    return UNKNOWN if value_s is None else f"{1000 * value_s:.0f}"


LATENCY_COLUMNS = tuple(
    Column(f"{stage}-ms", f"{stage} [ms]\np50 p99 max", _stage(stage), 13 + number, 14, right=True)
    for number, stage in enumerate((TOTAL, *STAGES))
)
COLUMNS = (
    Column("vehicle", "vehicle", lambda state: Text(state.name), 0, 7),
    Column("phase", "phase", _phase, 1, 9),
    Column("arbiter", "arbiter", _arbiter, 2, 8),
    Column("flown-by", "flown by", _flown_by, 4, 8),
    Column("follows", "follows", lambda state: Text(", ".join(state.leaders) or UNKNOWN), 5, 7),
    Column("position", "x y z\n[m]", _position, 10, 17),
    Column("error", "error\n[mm]", lambda state: _milliseconds(state.error_m), 3, 5, right=True),
    Column("pose", "pose age\n[ms]", _seen, 6, 8, right=True),
    Column(
        "command",
        "command\nage [ms]",
        lambda state: _milliseconds(None if state.transmitter is None else state.transmitter.command_age_s),
        9,
        8,
        right=True,
    ),
    Column(
        "missed",
        "missed\nperiods",
        lambda state: UNKNOWN if state.agent is None else str(state.agent.diagnostics.missed_ticks),
        7,
        7,
        right=True,
    ),
    Column("solve", "solve p50 / p99\n[ms]", _solve, 11, 15, right=True),
    Column(
        "link",
        "link",
        lambda state: Text(UNKNOWN if state.transmitter is None else state.transmitter.link),
        12,
        4,
    ),
    Column("events", "fallbacks,\nrejections", _events, 8, 18, wraps=True),
    *LATENCY_COLUMNS,
)
"""In the order in which they are shown."""
