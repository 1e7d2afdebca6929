"""The signals of a vehicle over time, for trails, sparklines and plots."""

from collections.abc import Sequence
from typing import Final

from rcopterx.ground_station.report.latency import TOTAL
from rcopterx.ground_station.scripting.state import VehicleState, shown_heading_deg

SAMPLE_S: Final = 0.1
KEPT_S: Final = 120.0


SIGNALS: Final = (
    ("x_m", "x", "m", 3), ("y_m", "y", "m", 3), ("z_m", "z", "m", 3), ("heading_deg", "heading", "°", 0),
    ("reference_x_m", "x of reference", "m", 3), ("reference_y_m", "y of reference", "m", 3),
    ("reference_z_m", "z of reference", "m", 3), ("error_mm", "error", "mm", 1),
    ("pitch", "pitch stick", "", 3), ("roll", "roll stick", "", 3), ("thrust", "thrust stick", "", 3),
    ("yaw", "yaw stick", "", 3), ("solve_ms", "solver, median", "ms", 2), ("voltage_v", "battery", "V", 2),
    ("latency_ms", "pose to radio, median", "ms", 1),
)  # fmt: skip
"""Signals that plots offer: name, label, unit, digits after the point."""


def sample_of(state: VehicleState, sticks: Sequence[float] | None) -> list[float | None]:
    """Values of `SIGNALS`, None where unknown; `sticks` as written to the radio, or None."""
    agent, plan = state.agent, state.plan
    flown = plan.reference if plan is not None and plan.airborne else None
    yaw_rad = None if agent is None else agent.yaw_rad
    battery = None if state.transmitter is None else state.transmitter.battery
    values = (
        *(state.place_m or 3 * (None,)),
        None if yaw_rad is None else shown_heading_deg(yaw_rad),
        *(3 * (None,) if flown is None else flown[:3]),
        None if state.error_m is None else 1000.0 * state.error_m,
        *(sticks or 4 * (None,)),
        None if agent is None else agent.diagnostics.solve_ms_p50,
        None if battery is None else battery.voltage_v,
        state.latency_ms.get(TOTAL, {}).get("p50"),
    )
    return [
        None if value is None else round(float(value), digits)
        for value, (*_, digits) in zip(values, SIGNALS, strict=True)
    ]
