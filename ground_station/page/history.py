"""The signals of a vehicle over time, for trails, sparklines and plots."""

from collections.abc import Sequence
from typing import Final

from rcopterx.ground_station.report.latency import TOTAL
from rcopterx.ground_station.scripting.state import VehicleState, shown_heading_deg
from rcopterx.tables import table_beside

SAMPLE_S: Final = 0.1
KEPT_S: Final = 120.0
SIGNALS: Final = tuple((name, *row) for name, row in table_beside(__file__, "signals").items())
"""Signals that plots offer: name, label, unit, digits after the point."""


def sample_of(state: VehicleState, sticks: Sequence[float] | None) -> list[float | None]:
    """Values of `SIGNALS`, None where unknown; `sticks` as written to the radio, or None."""
    agent, plan = state.agent, state.plan
    flown = plan.reference if plan is not None and plan.airborne else None
    yaw_rad = None if agent is None else agent.yaw_rad
    values = (
        *(state.place_m or 3 * (None,)),
        None if yaw_rad is None else shown_heading_deg(yaw_rad),
        *(3 * (None,) if flown is None else flown[:3]),
        None if state.error_m is None else 1000.0 * state.error_m,
        *(sticks or 4 * (None,)),
        None if agent is None else agent.diagnostics.solve_ms_p50,
        None if state.battery is None else state.battery.voltage_v,
        state.latency_ms.get(TOTAL, {}).get("p50"),
    )
    return [
        None if value is None else round(float(value), digits)
        for value, (*_, digits) in zip(values, SIGNALS, strict=True)
    ]
