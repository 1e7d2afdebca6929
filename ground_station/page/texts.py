"""The state of a fleet as HTML for the page; every number with its unit."""

import math
from collections.abc import Collection, Iterable, Sequence
from html import escape
from typing import Final

from rcopterx.ground_station.events import Event
from rcopterx.ground_station.report.latency import STAGES, TOTAL
from rcopterx.ground_station.scripting.state import VehicleState

EVENTS_SHOWN: Final = 30
_ALARM: Final = "color:#fff;background:#c81e1e;border-radius:4px;padding:2px 6px;font-weight:600"
_TABLE: Final = "font-size:0.8em;line-height:1.45;border-spacing:0;width:100%;overflow-wrap:anywhere"
_CELL: Final = "color:#777;padding:0 0.8em 0 0.6em;vertical-align:top"
_NAME: Final = f"{_CELL};width:42%"
_SHORT: Final = f"{_CELL};white-space:nowrap;width:1%"


def banner(fleet_name: str, states: Collection[VehicleState], problems: Sequence[str]) -> str:
    """Name of the fleet, and below it alarms and the problems that block take-off."""
    alarms = [f"{state.name}: {transmitter_text(state)}" for state in states if state.alarming]
    alarms += [
        f"{state.name}: {remark}"
        for state in states
        if state.agent is not None
        for remark in state.agent.diagnostics.remarks
    ]
    lines = [f'<div style="{_ALARM};margin:3px 0">{escape(line)}</div>' for line in alarms]
    lines += [f'<div style="color:#b45309">{escape(line)}</div>' for line in problems if line not in alarms]
    return f'<div style="font-size:0.85em;padding:0 0.5em"><b>{escape(fleet_name)}</b>{"".join(lines)}</div>'


def transmitter_text(state: VehicleState) -> str:
    """State of the transmitter with its reason, which may begin with the state."""
    if state.transmitter is None:
        return state.transmitter_state
    reason = state.transmitter.reason.removeprefix(f"{state.transmitter_state}: ")
    return f"{state.transmitter_state}: {reason}"


def vehicle_table(state: VehicleState) -> str:
    """State of one vehicle, a row for each quantity."""
    rows = "".join(
        f'<tr><td style="{_NAME}">{escape(name)}</td>'
        f'<td style="{_ALARM if alarming else ""}">{escape(text)}</td></tr>'
        for name, text, alarming in _rows(state)
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


def _rows(state: VehicleState) -> Iterable[tuple[str, str, bool]]:
    agent, transmitter = state.agent, state.transmitter
    yield "phase", state.phase + (" (agent does not respond)" if state.silent else ""), state.silent
    if transmitter is not None:
        yield "transmitter", transmitter_text(state), state.alarming
        yield "radio", f"{transmitter.link}, {transmitter.module}", False
        yield "command age", _milliseconds(transmitter.command_age_s), False
    yield "seen", _milliseconds(state.seen_age_s) + " ago", False
    if agent is None:
        return
    values = agent.diagnostics
    for remark in values.remarks:
        yield "remark", remark, True
    flown_by = f"{values.client} (external program)" if values.client else values.controller
    lowered = values.effort_factor != 1.0
    factor = f", bandwidth lowered (effort × {values.effort_factor:g})" if lowered else ""
    yield "flown by", flown_by + factor, values.effort_factor > 1.0
    yield "estimator", values.estimator, False
    yield "follows", ", ".join(state.leaders) or "-", False
    if agent.following_mode != "follow":
        yield "leader lost", agent.following_mode, True
    yield "position", _metres(agent.position_m), False
    yield "heading", "-" if agent.yaw_rad is None else f"{round(math.degrees(agent.yaw_rad))}°", False
    yield "error", "-" if state.error_m is None else f"{1000 * state.error_m:.0f} mm", False
    if values.hover_thrust is not None:
        yield "battery", f"hovers at {100 * values.hover_thrust:.0f} % of the thrust", False
    if values.wind_m_s2 is not None:
        yield "wind", f"{math.hypot(*values.wind_m_s2):.2f} m/s²", False
    if values.position_deviation_m is not None:
        yield "uncertainty (2σ)", _millimetres(values.position_deviation_m), False
    yield "horizon", f"{values.horizon} stages", False
    yield "solver p50 / p99", f"{values.solve_ms_p50:.2f} / {values.solve_ms_p99:.2f} ms", False
    yield "missed periods", f"{values.missed_ticks} of {values.ticks}", False
    yield from _latency_rows(state)
    if agent.path_left_s > 0.0:
        yield "trajectory", f"{agent.path_left_s:.0f} s left", False
    counts = ", ".join(f"{kind} {count}" for kind, count in state.event_counts.items())
    yield "fallbacks, rejections", counts or "none", False


def _latency_rows(state: VehicleState) -> Iterable[tuple[str, str, bool]]:
    for stage, figures in state.latency_ms.items():
        name = "latency p50 / p99 / max, capture to serial port" if stage == TOTAL else f"· {STAGES[stage]}"
        yield name, f"{figures['p50']:.1f} / {figures['p99']:.1f} / {figures['max']:.1f} ms", False


def _metres(place: Sequence[float] | None) -> str:
    return "-" if place is None else ", ".join(f"{value:.2f}" for value in place) + " m"


def _millimetres(deviation_m: Sequence[float]) -> str:
    """Two standard deviations along x, y and z."""
    return ", ".join(f"{2000 * value:.1f}" for value in deviation_m) + " mm"


def _milliseconds(value_s: float | None) -> str:
    return "-" if value_s is None else f"{1000 * value_s:.0f} ms"


def _ago(age_s: float) -> str:
    return f"{age_s:.0f} s" if age_s < 120.0 else f"{age_s / 60.0:.0f} min"
