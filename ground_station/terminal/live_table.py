"""The live table of a fleet in a terminal: as many columns as its width has room for."""

from collections.abc import Sequence

from rich.console import Group
from rich.table import Table
from rich.text import Text

from rcopterx.ground_station.quantities import QUANTITIES, Quantity
from rcopterx.ground_station.scripting.fleet import Fleet

GAP = 2  # blanks between two columns
COLUMNS = tuple(quantity for quantity in QUANTITIES if quantity.width)
FULL_WIDTH = sum(column.width + GAP for column in COLUMNS)  # of a terminal with room for all columns


def fitting(width: int) -> list[Quantity]:
    """First columns that fit into a terminal of `width` characters, at least that of the vehicle."""
    shown, used = [COLUMNS[0]], COLUMNS[0].width
    for column in COLUMNS[1:]:
        used += GAP + column.width
        if used > width:
            break
        shown.append(column)
    return shown


def fleet_view(fleet: Fleet, columns: Sequence[Quantity]) -> Group:
    """All vehicles of a running fleet, and below them problems that block take-off, and notes."""
    table = Table(
        title=Text(tracker_line(fleet)),
        title_justify="left",
        box=None,
        padding=(0, GAP, 0, 0),
        pad_edge=False,
    )
    for column in columns:
        table.add_column(Text(column.name), overflow="fold", width=column.width)
    for vehicle in fleet:
        state = vehicle.state
        # Texts from the bus are shown as they are, whatever brackets they contain.
        cells = (Text(one.text(state) or "-", "red" if one.alarming(state) else "") for one in columns)
        table.add_row(*cells)
    problems = (Text(line, style="red") for line in fleet.problems())
    return Group(table, *problems, *(Text(f"note: {line}", style="dim") for line in fleet.notes()))


def tracker_line(fleet: Fleet) -> str:
    """Name of the fleet and state of its motion capture."""
    if (received := fleet.tracker.latest()) is None:
        return f"{fleet.file.title}: Vicon gateway not responding yet"
    status = received.message
    if status.state != "up":
        return f"{fleet.file.title}: Tracker {status.trying}"
    rate = 1 / status.period_s if status.period_s else 0.0
    return f"{fleet.file.title}: Tracker {status.address}, frame {status.frame}, {rate:.0f} Hz"
