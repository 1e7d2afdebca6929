"""The live table of a fleet in a terminal."""

from collections import Counter
from collections.abc import Iterable

from rich.console import Group
from rich.table import Table
from rich.text import Text

from ground_station.fleet import Fleet
from ground_station.state import VehicleState

STALE_S = 0.5
COLUMNS = (
    "vehicle", "phase", "transmitter", "link", "controller", "follows", "x y z [m]", "error [mm]",
    "pose age [ms]", "command age [ms]", "solve p50 / p99 [ms]", "missed periods", "fallbacks, rejections",
)  # fmt: skip


def fleet_table(fleet: Fleet) -> Table:
    """All vehicles of a running fleet: phases, ages, solver times, and everything that went wrong."""
    # Texts from the bus are shown as they are, whatever brackets they contain.
    table = Table(title=Text(_tracker_line(fleet)), title_justify="left", expand=False)
    for heading in COLUMNS:
        table.add_column(Text(heading), no_wrap=heading not in ("link", "fallbacks, rejections"))
    for vehicle in fleet:
        table.add_row(*_row(vehicle.state))
    return table


def fleet_view(fleet: Fleet) -> Group:
    """The table, and below it what blocks take-off, and what is worth knowing."""
    problems = [Text(line, style="red") for line in fleet.problems()]
    notes = [Text(f"note: {line}", style="dim") for line in fleet.notes()]
    return Group(fleet_table(fleet), *problems, *notes)


def _tracker_line(fleet: Fleet) -> str:
    received = fleet.tracker.latest()
    if received is None:
        return f"{fleet.file.name}: Vicon gateway not responding yet"
    status = received.message
    if status.state != "up":
        return f"{fleet.file.name}: Tracker {status.trying}"
    rate = 1 / status.period_s if status.period_s else 0.0
    return f"{fleet.file.name}: Tracker {status.address}, frame {status.frame}, {rate:.0f} Hz"


def _row(state: VehicleState) -> Iterable[Text | str]:
    agent, transmitter = state.agent, state.transmitter
    stale = state.agent_age_s is None or state.agent_age_s > STALE_S
    style = "red" if stale else ("green" if state.phase == "flying" else "")
    yield state.name
    yield Text(state.phase if not stale else f"{state.phase} (silent)", style=style)
    yield "-" if transmitter is None else transmitter.state
    yield Text("-" if transmitter is None else transmitter.link)
    if agent is None:
        yield from ("-",) * (len(COLUMNS) - 4)
        return
    factor = agent.diagnostics.effort_factor
    yield Text(agent.diagnostics.controller + ("" if factor == 1.0 else f" (effort x {factor:g})"))
    yield ", ".join(state.leaders) or "-"
    yield "-" if agent.position_m is None else " ".join(f"{value:6.2f}" for value in agent.position_m)
    yield "-" if state.error_m is None else f"{1000 * state.error_m:.0f}"
    yield _milliseconds(agent.diagnostics.pose_age_s if state.seen_age_s is None else state.seen_age_s)
    yield _milliseconds(None if transmitter is None else transmitter.command_age_s)
    yield f"{agent.diagnostics.solve_ms_p50:.2f} / {agent.diagnostics.solve_ms_p99:.2f}"
    yield str(agent.diagnostics.missed_ticks)
    counts = Counter(agent.diagnostics.fallbacks) + Counter(agent.diagnostics.rejected)
    counts += Counter({} if transmitter is None else transmitter.rejected)
    yield Text(", ".join(f"{kind} {count}" for kind, count in counts.items()) or "-")


def _milliseconds(value_s: float | None) -> str:
    return "-" if value_s is None else f"{1000 * value_s:.0f}"
