"""Flights recorded elsewhere: CSV of poses and inputs of any vehicle, by a map of its columns.

Without a map it is of a Crazyflie, in the columns of NanoBench (https://github.com/syediu/nanobench-iros2026):
seconds, metres, quaternions, attitude commands in degrees, thrust, volts.
"""

import gzip
import math
import tomllib
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import msgspec
import numpy as np
from scipy.signal import medfilt

from rcopterx.control.identification.recording import (
    LONGEST_GAP_S,
    FlightRecording,
    RecordingError,
    interpolated,
)
from rcopterx.control.interfaces import Measurement
from rcopterx.radios.crtp import FULL_THRUST
from rcopterx.radios.set_points import FullStick
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
SPIKE_ROWS: Final = 2  # longest spike of a stick that is removed
_UNIT: Final = 0.01  # largest departure of a quaternion's length from one


class ColumnMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Which columns are poses, and of which columns the sticks are sums, with a factor each."""

    pitch: dict[str, float]
    """Stick that accelerates forward."""
    roll: dict[str, float]
    """Stick that accelerates to the left."""
    thrust: dict[str, float]
    """From 0 to 1."""
    yaw: dict[str, float] = {}
    """Stick that turns to the left."""
    type: str = "coaxial"
    """Type that the vehicle is an example of."""
    time: str = TIME
    """Seconds."""
    pose: tuple[str, str, str, str, str, str, str] = POSE
    """Metres, and the quaternion x, y, z, w."""
    from_s: float = -math.inf
    """Rows before this time are left out, as of a vehicle in a hand."""
    until_s: float = math.inf
    """Rows from this time on are left out."""

    @property
    def sticks(self) -> tuple[dict[str, float], ...]:
        """Sums of the four sticks."""
        return self.pitch, self.roll, self.thrust, self.yaw


def read_columns(path: Path) -> ColumnMap:
    """Read a map of columns, a TOML file; `RecordingError` says what is wrong with it."""
    try:
        return msgspec.convert(tomllib.loads(decoded(path.read_bytes())), ColumnMap)
    except (OSError, TextError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise RecordingError(f"{path}: {error}") from None


def read_mapped(path: Path, kind: str, columns: ColumnMap) -> FlightRecording:
    """Read a CSV file by a map of its columns, as a flight of a type, at regular times.

    Spikes of sticks that are at most `SPIKE_ROWS` rows long are removed. Raises `RecordingError`, which names
    file and line.
    """
    named = list(dict.fromkeys(name for stick in columns.sticks for name in stick))
    try:
        numbers = _content(path, (columns.time, *columns.pose, *named))
        kept = (numbers[:, 1] >= columns.from_s) & (numbers[:, 1] < columns.until_s)
        poses = _regular_poses(numbers[kept, : 2 + len(POSE)])
        inputs = {
            name: medfilt(column, 2 * SPIKE_ROWS + 1)
            for name, column in zip(named, numbers[kept, 2 + len(POSE) :].T, strict=True)
        }
        still = np.zeros(len(poses.time_s))
        sticks = [sum((share * inputs[name] for name, share in one.items()), still) for one in columns.sticks]
        return poses.recording(kind, np.column_stack(sticks))
    except (OSError, EOFError, zlib.error, TextError, RecordingError) as error:
        raise RecordingError(f"{path}: {error}") from None


def is_csv(path: Path) -> bool:
    """Whether a file's name is that of a CSV file, compressed or not."""
    return path.name.endswith(SUFFIXES)


def read_flight(path: Path, kind: str, full: FullStick, full_thrust: float = FULL_THRUST) -> FlightRecording:
    """Read the part of a CSV file in which the vehicle flies, as one of a type, at regular times.

    `full`, and `full_thrust` in the firmware's units, are what full sticks command.
    Raises `RecordingError`, which names file and line: nothing flies, values or poses are missing or wrong.
    """
    try:
        numbers = _content(path, COLUMNS)
        height_m = numbers[:, 2 + POSE.index("pz")]
        flying = np.flatnonzero(height_m > np.min(height_m, initial=np.inf) + AIRBORNE_M)
        if len(flying) < 2:
            raise RecordingError(f"nothing flies: no poses {AIRBORNE_M:g} m above the lowest one")
        flown = numbers[flying[0] : flying[-1] + 1]
        poses = _regular_poses(flown[:, : 2 + len(POSE)])
        pitch_deg, roll_deg, thrust, yaw_deg, volts = flown[:, 2 + len(POSE) :].T
        yaw_rate_deg_s = np.gradient(np.unwrap(yaw_deg, period=360.0), poses.time_s)
        # The firmware pitches up and rolls to the right for positive angles.
        sticks = (-pitch_deg / full.full_tilt_deg, -roll_deg / full.full_tilt_deg, thrust / full_thrust,
                  yaw_rate_deg_s / full.full_yaw_rate_deg_s)  # fmt: skip
        return poses.recording(kind, np.column_stack(sticks), volts)
    except (OSError, EOFError, zlib.error, TextError, RecordingError) as error:
        raise RecordingError(f"{path}: {error}") from None


def _content(path: Path, columns: Sequence[str]) -> Array:
    """Line and numbers of some columns of every row, shape (K, 1 + n)."""
    content = path.read_bytes()
    text = decoded(gzip.decompress(content) if path.name.endswith(".gz") else content)
    return np.array(list(_numbers(rows_of(text), columns))).reshape(-1, 1 + len(columns))


def _numbers(rows: Iterator[Row], columns: Sequence[str]) -> Iterator[list[float]]:
    header = next(rows, Row(0, [])).cells
    missing = [name for name in columns if name not in header]
    if missing:
        raise RecordingError(f"no column {', '.join(missing)}")
    places = [header.index(name) for name in columns]
    for line, cells in rows:
        if len(cells) != len(header):
            raise RecordingError(f"line {line}: {len(cells)} values instead of {len(header)}")
        named = zip(places, columns, strict=True)
        yield [line, *(number_in(cells[place], f"line {line}, column {name}") for place, name in named)]


class _Poses(NamedTuple):
    """Poses of rows, and the regular times at which a recording has them."""

    time_s: Array
    period_s: float
    measured: list[Measurement]

    def recording(self, kind: str, sticks: Array, volts: Array | None = None) -> FlightRecording:
        """Return the recording with the sticks, shape (K, 4), and the voltage of each row."""
        regular_s = np.arange(self.time_s[0], self.time_s[-1], self.period_s)
        yaw_rad = np.unwrap([one.yaw_rad for one in self.measured])
        return FlightRecording(
            kind,
            self.period_s,
            interpolated(regular_s, self.time_s, np.array([one.position_m for one in self.measured])),
            np.interp(regular_s, self.time_s, yaw_rad),
            interpolated(regular_s, self.time_s, np.array([one.tilt for one in self.measured])),
            interpolated(regular_s, self.time_s, sticks),
            None if volts is None else np.interp(regular_s, self.time_s, volts),
        )


def _regular_poses(rows: Array) -> _Poses:
    """Check line, time and pose of every row; their gaps are short."""
    if len(rows) < 2:
        raise RecordingError("fewer than two rows")
    lines, time_s, poses = rows[:, 0], rows[:, 1], rows[:, 2:]
    steps_s = np.diff(time_s)
    flaws = (steps_s <= 0.0, "time does not increase"), (steps_s > LONGEST_GAP_S, "poses are missing")
    for wrong, why in flaws:
        if wrong.any():
            at = int(np.argmax(wrong))
            raise RecordingError(
                f"line {lines[at + 1]:.0f}: {why}, {steps_s[at]:.3f} s since the line before"
            )
    if (np.abs(np.linalg.norm(poses[:, 3:], axis=1) - 1.0) > _UNIT).any():
        raise RecordingError(f"{', '.join(POSE[3:])}: not a unit quaternion")
    period_s = max(round(float(np.median(steps_s)), 4), PERIOD_S)
    return _Poses(time_s, period_s, [Measurement.of_pose(pose[:3], pose[3:]) for pose in poses])
