"""The live table of a fleet in a terminal."""

from collections import Counter
from collections.abc import Iterable

from rich.table import Table
from rich.text import Text

from ground_station.fleet import Fleet, VehicleState

STALE_S = 0.5


def fleet_table(fleet: Fleet) -> Table:
    """All vehicles of a running fleet: phases, ages, solver times, and everything that went wrong."""
    # Texts from the bus are shown as they are, whatever brackets they contain.
    table = Table(title=Text(_tracker_line(fleet)), title_justify="left", expand=False)
    for heading in (
        "vehicle", "phase", "transmitter", "follows", "x y z [m]", "pose age [ms]", "command age [ms]",
        "solve p50 / p99 [ms]", "missed", "fallbacks, rejections",
    ):  # fmt: skip
        table.add_column(heading, no_wrap=True)
    for vehicle in fleet:
        table.add_row(*_row(vehicle.state))
    return table


def _tracker_line(fleet: Fleet) -> str:
    received = fleet.tracker.latest()
    if received is None:
        return f"{fleet.file.name}: no word from the Vicon gateway yet"
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
    if agent is None:
        yield from ("-",) * 6
        return
    yield ", ".join(link.leader for link in agent.following) or "-"
    yield "-" if agent.position_m is None else " ".join(f"{value:6.2f}" for value in agent.position_m)
    yield _milliseconds(agent.pose_age_s)
    yield _milliseconds(None if transmitter is None else transmitter.command_age_s)
    yield f"{agent.solve_ms_p50:.2f} / {agent.solve_ms_p99:.2f}"
    yield str(agent.missed_ticks)
    counts = Counter(agent.fallbacks) + Counter(agent.rejected)
    counts += Counter({} if transmitter is None else transmitter.rejected)
    yield Text(", ".join(f"{kind} {count}" for kind, count in counts.items()) or "-")


def _milliseconds(value_s: float | None) -> str:
    return "-" if value_s is None else f"{1000 * value_s:.0f}"
