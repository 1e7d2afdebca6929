"""Texts of the page as HTML: the banner with alarms, the tables of the vehicles, the list of events."""

from collections.abc import Collection, Sequence
from html import escape
from typing import Final

from rcopterx.fleet.schema import FleetFile
from rcopterx.ground_station.events import Event
from rcopterx.ground_station.quantities import QUANTITIES
from rcopterx.ground_station.scripting.state import VehicleState

EVENTS_SHOWN: Final = 30
_ALARM: Final = "color:#fff;background:#c81e1e;border-radius:4px;padding:2px 6px;font-weight:600"
_SMALL: Final = "font-size:0.85em;padding:0 0.5em"
_TABLE: Final = "font-size:0.8em;line-height:1.45;border-spacing:0;width:100%;overflow-wrap:anywhere"
_CELL: Final = "color:#777;padding:0 0.8em 0 0.6em;vertical-align:top"
_NAME: Final = f"{_CELL};width:42%"
_SHORT: Final = f"{_CELL};white-space:nowrap;width:1%"


def banner(fleet_name: str, states: Collection[VehicleState], problems: Sequence[str]) -> str:
    """Fleet and phases of its vehicles, and below them alarms and the problems that block take-off."""
    alarms = [
        f"{state.name}: {state.transmitter_state}: {state.reason}" for state in states if state.alarming
    ]
    alarms += [
        f"{state.name}: {remark}"
        for state in states
        if state.agent is not None
        for remark in state.agent.diagnostics.remarks
    ]
    lines = [f'<div style="{_ALARM};margin:3px 0">{escape(line)}</div>' for line in alarms]
    lines += [f'<div style="color:#b45309">{escape(line)}</div>' for line in problems if line not in alarms]
    phases = " · ".join(f"{escape(state.name)} {escape(state.phase)}" for state in states)
    return f'<div style="{_SMALL}"><b>{escape(fleet_name)}</b> {phases}{"".join(lines)}</div>'


def suggestions(fleet: FleetFile) -> str:
    """What to try in flight, in one sentence."""
    leaders = [name for name, vehicle in fleet.vehicles.items() if not vehicle.follow]
    ideas = [f"drag the handle of <b>{leaders[0]}</b>"]
    if followers := [name for name in fleet.vehicles if name not in leaders]:
        ideas.append(f"choose another leader in the tab of <b>{followers[-1]}</b>")
    ideas.append(f"kill an agent: <code>pkill -9 -xf &quot;rcopterx agent {leaders[0]}&quot;</code>")
    return f'<div style="{_SMALL}">In flight: {", ".join(ideas[:-1])}, or {ideas[-1]}</div>'


def vehicle_table(state: VehicleState) -> str:
    """State of one vehicle, a row for each quantity that it has."""
    rows = "".join(
        f'<tr><td style="{_NAME}">{escape(quantity.name)}</td>'
        f'<td style="{_ALARM if quantity.alarming(state) else ""}">{escape(text)}</td></tr>'
        for quantity in QUANTITIES[1:]
        if (text := quantity.text(state))
    )
    return f'<table style="{_TABLE}">{rows}</table>'


def event_list(events: Sequence[Event], now_s: float) -> str:
    """Newest events first, with their age."""
    rows = "".join(
        f'<tr><td style="{_SHORT}">{_ago(now_s - event.time_s)}</td>'
        f'<td style="{_SHORT}">{escape(event.vehicle)}</td>'
        f'<td style="{_ALARM if event.alarming else ""}">{escape(event.words)}</td></tr>'
        for event in list(events)[: -EVENTS_SHOWN - 1 : -1]
    )
    return f'<table style="{_TABLE}">{rows or "<tr><td>nothing has happened yet</td></tr>"}</table>'


def _ago(age_s: float) -> str:
    return f"{age_s:.0f} s" if age_s < 120.0 else f"{age_s / 60.0:.0f} min"
