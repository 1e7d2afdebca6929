"""Flights recorded elsewhere: CSV of poses and attitude commands, in the columns of NanoBench.

https://github.com/syediu/nanobench-iros2026: seconds, metres, quaternions, degrees, thrust, volts.
"""

import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from rcopterx.control.identification.recording import (
    LONGEST_GAP_S,
    FlightRecording,
    RecordingError,
    interpolated,
)
from rcopterx.control.interfaces import Measurement
from rcopterx.user_text import Row, TextError, decoded, number_in, rows_of
from rcopterx.vehicles.state import Array

SUFFIXES: Final = (".csv", ".csv.gz")
TIME: Final = "t"
POSE: Final = ("px", "py", "pz", "qx", "qy", "qz", "qw")
COMMANDS: Final = tuple(f"pid_controller_{name}" for name in ("pitch", "roll", "cmd_thrust", "yaw"))
BATTERY: Final = "pwr_pm_vbat"
COLUMNS: Final = (TIME, *POSE, *COMMANDS, BATTERY)
PERIOD_S: Final = 0.02  # at which flights are read, or at their own period if that is longer
AIRBORNE_M: Final = 0.3  # a vehicle flies from when it first is so far above its lowest pose until it last is
_UNIT: Final = 0.01  # largest departure of a quaternion's length from one


@dataclass(frozen=True)
class CommandScale:
    """What full sticks command: roll and pitch, rate of yaw, thrust in the firmware's units."""

    tilt_deg: float
    yaw_rate_deg_s: float
    thrust: float


def is_csv(path: Path) -> bool:
    """Whether a file's name is that of a CSV file, compressed or not."""
    return path.name.endswith(SUFFIXES)


def read_flight(path: Path, kind: str, full: CommandScale) -> FlightRecording:
    """Read the part of a CSV file in which the vehicle flies, as one of a type, at regular times.

    Raises `RecordingError`, which names file and line: nothing flies, values or poses are missing or wrong.
    """
    try:
        rows = np.array(list(_numbers(rows_of(decoded(_content(path))))))
        return _recording(rows, kind, full)
    except (OSError, EOFError, zlib.error, TextError, RecordingError) as error:
        raise RecordingError(f"{path}: {error}") from None


def _content(path: Path) -> bytes:
    content = path.read_bytes()
    return gzip.decompress(content) if path.name.endswith(".gz") else content


def _numbers(rows: Iterator[Row]) -> Iterator[list[float]]:
    """Line and numbers of `COLUMNS` of every row."""
    header = next(rows, Row(0, [])).cells
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise RecordingError(f"no column {', '.join(missing)}")
    places = [header.index(name) for name in COLUMNS]
    for line, cells in rows:
        if len(cells) != len(header):
            raise RecordingError(f"line {line}: {len(cells)} values instead of {len(header)}")
        named = zip(places, COLUMNS, strict=True)
        yield [line, *(number_in(cells[place], f"line {line}, column {name}") for place, name in named)]


def _recording(numbers: Array, kind: str, full: CommandScale) -> FlightRecording:
    lines, rows = (numbers[:, 0], numbers[:, 1:]) if len(numbers) else (numbers, numbers)
    height_m = rows[:, 1 + POSE.index("pz")] if len(rows) else np.zeros(1)
    flying = np.flatnonzero(height_m > height_m.min() + AIRBORNE_M)
    if len(flying) < 2:
        raise RecordingError(f"nothing flies: no poses {AIRBORNE_M:g} m above the lowest one")
    time_s = rows[flying[0] : flying[-1] + 1, 0]
    steps_s = np.diff(time_s)
    flaws = (steps_s <= 0.0, "time does not increase"), (steps_s > LONGEST_GAP_S, "poses are missing")
    for wrong, why in flaws:
        if wrong.any():
            at = int(np.argmax(wrong))
            line = lines[flying[0] + at + 1]
            raise RecordingError(f"line {line:.0f}: {why}, {steps_s[at]:.3f} s since the line before")
    period_s = max(round(float(np.median(steps_s)), 4), PERIOD_S)
    regular_s = np.arange(time_s[0], time_s[-1], period_s)
    flown = rows[flying[0] : flying[-1] + 1]
    poses, commands = flown[:, 1 : 1 + len(POSE)], flown[:, 1 + len(POSE) : -1]
    if (np.abs(np.linalg.norm(poses[:, 3:], axis=1) - 1.0) > _UNIT).any():
        raise RecordingError(f"{', '.join(POSE[3:])}: not a unit quaternion")
    measured = [Measurement.of_pose(pose[:3], pose[3:]) for pose in poses]
    yaw_rad = np.unwrap([one.yaw_rad for one in measured])
    pitch_deg, roll_deg, thrust, yaw_deg = commands.T
    yaw_rate_deg_s = np.gradient(np.unwrap(yaw_deg, period=360.0), time_s)
    # The firmware pitches up and rolls to the right for positive angles.
    sticks = (-pitch_deg / full.tilt_deg, -roll_deg / full.tilt_deg, thrust / full.thrust,
              yaw_rate_deg_s / full.yaw_rate_deg_s)  # fmt: skip
    return FlightRecording(
        kind,
        period_s,
        interpolated(regular_s, time_s, poses[:, :3]),
        np.interp(regular_s, time_s, yaw_rad),
        interpolated(regular_s, time_s, np.array([one.tilt for one in measured])),
        interpolated(regular_s, time_s, np.column_stack(sticks)),
        np.interp(regular_s, time_s, flown[:, -1]),
    )
