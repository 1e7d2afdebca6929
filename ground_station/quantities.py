"""The quantities of a vehicle as text, for the table of the terminal and for the page."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rcopterx.bus.messages import AgentStatus, Diagnostics, TransmitterStatus
from rcopterx.ground_station.report.latency import STAGES, TOTAL
from rcopterx.ground_station.scripting.state import VehicleState, shown_heading_deg

Text = Callable[[VehicleState], str]
BAR = 8  # characters of a bar


class Quantity(NamedTuple):
    """A quantity; `text` is empty where a vehicle does not have it."""

    name: str
    text: Text
    width: int = 0  # of its column in the terminal; 0 for the page only
    alarming: Callable[[VehicleState], bool] = lambda _: False


def _agent(text: Callable[[AgentStatus], str]) -> Text:
    return lambda state: "" if state.agent is None else text(state.agent)


def _diagnostics(text: Callable[[Diagnostics], str]) -> Text:
    return _agent(lambda agent: text(agent.diagnostics))


def _transmitter(text: Callable[[TransmitterStatus], str]) -> Text:
    return lambda state: "" if state.transmitter is None else text(state.transmitter)


def _effort_factor(state: VehicleState) -> float:
    return 1.0 if state.agent is None else state.agent.diagnostics.effort_factor


def _flown_by(state: VehicleState) -> str:
    factor = _effort_factor(state)
    return state.flown_by + ("" if factor == 1.0 else f", effort × {factor:g}")


def _seen_ago(state: VehicleState) -> str:
    own_s = None if state.agent is None else state.agent.pose_age_s
    return _milli(own_s if state.seen_age_s is None else state.seen_age_s, "s")


def _latency(stage: str) -> Text:
    def text(state: VehicleState) -> str:
        figures = state.latency_ms.get(stage, {})
        return " / ".join(f"{value:.1f}" for value in figures.values()) + (" ms" if figures else "")

    return text


def _milli(value: float | None, unit: str) -> str:
    return "" if value is None else f"{1000 * value:.0f} m{unit}"


def _numbers(values: Sequence[float] | None, digits: int, unit: str, factor: float = 1.0) -> str:
    return "" if values is None else ", ".join(f"{factor * value:.{digits}f}" for value in values) + unit


def hover(values: Diagnostics) -> str:
    """Return the thrust with which the vehicle hovers; empty if it is unknown."""
    return "" if values.hover_thrust is None else f"hovers at {100 * values.hover_thrust:.0f} % of the thrust"


def voltage(state: VehicleState) -> str:
    """Return a bar of what the battery has left, its voltage and the flight time; empty if unknown."""
    share = None if state.battery is None else state.battery.share
    full = round(BAR * (share or 0.0))
    return ("" if share is None else f"{full * '█'}{(BAR - full) * '░'} ") + state.battery_text


def battery_low(state: VehicleState) -> bool:
    """Whether the voltage is below that of a take-off."""
    return state.battery is not None and state.battery.low


def _wind(values: Diagnostics) -> str:
    return "" if values.wind_m_s2 is None else f"{math.hypot(*values.wind_m_s2):.2f} m/s²"


QUANTITIES = (
    Quantity("vehicle", lambda state: state.name, 7),
    Quantity(
        "phase",
        lambda state: f"{state.phase} (silent)" if state.silent else state.phase,
        9,
        lambda state: state.silent,
    ),
    Quantity("arbiter", lambda state: state.transmitter_state, 8, lambda state: state.alarming),
    Quantity("reason", lambda state: state.reason, 0, lambda state: state.alarming),
    Quantity("remarks", _diagnostics(lambda values: "; ".join(values.remarks)), 0, lambda _: True),
    Quantity("error", lambda state: _milli(state.error_m, "m"), 7),
    Quantity("flown by", _flown_by, 10, lambda state: _effort_factor(state) > 1.0),
    Quantity("follows", lambda state: ", ".join(state.leaders), 7),
    Quantity(
        "leader lost",
        _agent(lambda agent: "" if agent.following_mode == "follow" else agent.following_mode),
        0,
        lambda _: True,
    ),
    Quantity("seen ago", _seen_ago, 7),
    Quantity("missed periods", _diagnostics(lambda values: str(values.missed_ticks)), 7),
    Quantity(
        "fallbacks, rejections",
        lambda state: ", ".join(f"{what} {n}" for what, n in state.event_counts.items()).replace("_", " "),
        18,
    ),
    Quantity("command age", _transmitter(lambda status: _milli(status.command_age_s, "s")), 7),
    Quantity("position", lambda state: _numbers(state.position_m, 2, " m"), 20),
    Quantity(
        "heading",
        _agent(lambda agent: "" if agent.yaw_rad is None else f"{shown_heading_deg(agent.yaw_rad)}°"),
    ),
    Quantity(
        "uncertainty (2σ)",
        _diagnostics(lambda values: _numbers(values.position_deviation_m, 1, " mm", 2000.0)),
    ),
    Quantity(
        "solver p50 / p99",
        _diagnostics(lambda values: f"{values.solve_ms_p50:.2f} / {values.solve_ms_p99:.2f} ms"),
        16,
    ),
    Quantity("voltage", voltage, 16, battery_low),
    Quantity("radio", _transmitter(lambda status: f"{status.link}, {status.module}"), 14),
    *(Quantity(f"latency {stage}, p50 / p99 / max", _latency(stage), 20) for stage in (TOTAL, *STAGES)),
    Quantity("estimator", _diagnostics(lambda values: values.estimator)),
    Quantity("horizon", _diagnostics(lambda values: f"{values.horizon} stages")),
    Quantity("battery", _diagnostics(hover)),
    Quantity("wind", _diagnostics(_wind)),
    Quantity(
        "trajectory",
        _agent(lambda agent: f"{agent.path_left_s:.0f} s left" if agent.path_left_s > 0.0 else ""),
    ),
)
"""In the order in which they are shown: in the terminal as many columns as there is room for."""
