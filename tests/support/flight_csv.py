"""CSV files as a laboratory records flights of a Crazyflie."""

from pathlib import Path

import numpy as np

from rcopterx.control.identification.recording import FlightRecording
from rcopterx.radios.crtp import FULL_THRUST
from rcopterx.radios.set_points import FullStick
from rcopterx_studies.experiments.flight_csv import COLUMNS

FULL = FullStick()
FLOOR_ROWS = 20


def rows_of(flight: FlightRecording) -> list[dict[str, float]]:
    """A flight of a vehicle that jumps up from the floor a metre below, by column."""
    assert flight.tilt is not None
    assert flight.battery_v is not None
    position_m, yaw_rad = flight.position_m, flight.yaw_rad
    start = position_m[:1] - [0.0, 0.0, position_m[0, 2] - position_m[:, 2].min() + 1.0]
    heading = np.column_stack((np.cos(yaw_rad / 2), np.sin(yaw_rad / 2)))
    yaw_deg = np.cumsum(FULL.full_yaw_rate_deg_s * flight.period_s * flight.inputs[:, 3])
    # The tilt turns about a horizontal axis, the heading about the vertical one before it.
    lean = np.sqrt((1 + np.sqrt(1 - np.sum(flight.tilt**2, axis=1))) / 2)
    across, along = flight.tilt[:, 0] / (2 * lean), -flight.tilt[:, 1] / (2 * lean)
    c, s = heading.T
    columns = {
        "t": 1.7e9 + flight.period_s * (FLOOR_ROWS + np.arange(len(yaw_rad))),
        "px": position_m[:, 0],
        "py": position_m[:, 1],
        "pz": position_m[:, 2],
        "qx": along * c + across * s,
        "qy": across * c - along * s,
        "qz": lean * s,
        "qw": lean * c,
        "pid_controller_pitch": -FULL.full_tilt_deg * flight.inputs[:, 0],
        "pid_controller_roll": -FULL.full_tilt_deg * flight.inputs[:, 1],
        "pid_controller_cmd_thrust": FULL_THRUST * flight.inputs[:, 2],
        "pid_controller_yaw": yaw_deg,
        "pwr_pm_vbat": flight.battery_v,
    }
    flown = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    floor = [
        {**flown[0], "t": 1.7e9 + flight.period_s * row, "pz": float(start[0, 2])}
        for row in range(FLOOR_ROWS)
    ]
    return [{name: float(value) for name, value in row.items()} for row in (*floor, *flown)]


def write_csv(path: Path, rows: list[dict[str, float]]) -> Path:
    """Write rows with a further column in front."""
    lines = [",".join(("imu_acc_x", *COLUMNS))]
    lines += [",".join(("0.5", *(repr(row[name]) for name in COLUMNS))) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
