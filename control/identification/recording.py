"""Poses and sticks of a flight for identification, one row per control period."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rcopterx.control.interfaces import Measurement
from rcopterx.vehicles.state import INPUT_SIZE, Array

FORMAT: Final = 1
# fields with a row per period, and the shapes of their rows
ROWS: Final = {"position_m": (3,), "yaw_rad": (), "tilt": (2,), "inputs": (INPUT_SIZE,), "battery_v": ()}
LONGEST_GAP_S: Final = 0.1  # missing poses up to this long are interpolated


class RecordingError(ValueError):
    """A recording that cannot be used; says why."""


@dataclass(frozen=True)
class FlightRecording:
    """Measured poses and commanded sticks at a fixed period, K rows without gaps; raises `RecordingError`."""

    kind: str  # type of the vehicle (`rcopterx.vehicles.model.Model.kind`)
    period_s: float
    position_m: Array  # inertial frame, shape (K, 3)
    yaw_rad: Array  # unwrapped, shape (K,)
    # horizontal components of the body's upward axis, inertial frame, shape (K, 2); None if not measured
    tilt: Array | None
    inputs: Array  # sticks sent to the vehicle on these poses, shape (K, 4); they act a transport delay later
    # voltage that the vehicle logged with its sticks, shape (K,); None if nothing was logged
    battery_v: Array | None = None

    def __post_init__(self) -> None:
        for name, value in self._rows().items():
            shape = (len(self.yaw_rad), *ROWS[name])
            if value.shape != shape:
                raise RecordingError(f"{name}: shape {value.shape} instead of {shape}")
            if not np.isfinite(value).all():
                raise RecordingError(f"{name}: not all numbers are finite")
        if not 0.0 < self.period_s <= 0.2:
            raise RecordingError(f"period_s: must be above 0 and at most 0.2 s, got {self.period_s}")

    @property
    def logged(self) -> bool:
        """Whether the vehicle logged the sticks, whose times are then up to about 0.03 s early or late."""
        return self.battery_v is not None

    @property
    def duration_s(self) -> float:
        """Duration of the flight."""
        return len(self.yaw_rad) * self.period_s

    def part(self, begin: float, end: float) -> "FlightRecording":
        """Return the rows between two fractions of the flight."""
        rows = slice(round(begin * len(self.yaw_rad)), round(end * len(self.yaw_rad)))
        return replace(self, **{name: value[rows] for name, value in self._rows().items()})

    def _rows(self) -> dict[str, Any]:
        """Arrays with a row per period, without those that are None."""
        values = {name: getattr(self, name) for name in ROWS}
        return {name: value for name, value in values.items() if value is not None}

    def save(self, path: Path) -> None:
        """Write a compressed numpy archive (`.npz`)."""
        head: dict[str, Any] = {"format": FORMAT, "kind": self.kind, "period_s": self.period_s}
        with path.open("wb") as file:
            np.savez_compressed(file, **head, **self._rows())


def load_recording(path: Path) -> FlightRecording:
    """Read a file of `FlightRecording.save`; raises `RecordingError` if it is missing or not a recording."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            return _recording({name: stored[name] for name in stored.files})
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from None
    except Exception as error:  # noqa: BLE001 - broken archives and their arrays raise many kinds
        raise RecordingError(f"{path}: no recording of a flight: {error}") from None


def _recording(found: Mapping[str, NDArray[Any]]) -> FlightRecording:
    missing = {"format", "kind", "period_s", "position_m", "yaw_rad", "inputs"} - found.keys()
    if missing:
        raise RecordingError(f"no recording of a flight: without {', '.join(sorted(missing))}")
    if not np.array_equal(found["format"], FORMAT):
        raise RecordingError(f"format {found['format']}, this version reads {FORMAT}")
    rows: dict[str, Any] = {name: found[name].astype(float) if name in found else None for name in ROWS}
    return FlightRecording(str(found["kind"]), float(found["period_s"]), **rows)


class FlightLog:
    """Collects a recording row by row; rows may be missing."""

    def __init__(self, kind: str, period_s: float) -> None:
        self._kind, self._period_s = kind, period_s
        self._poses: dict[int, Measurement] = {}
        self._inputs: dict[int, Array] = {}

    def add_pose(self, row: int, measurement: Measurement) -> None:
        """Add a pose by the number of its control period."""
        self._poses[row] = measurement

    def add_input(self, row: int, value: Array) -> None:
        """Add the sticks sent in a control period; of several the last counts."""
        self._inputs[row] = value

    def recording(self) -> FlightRecording:
        """Return the rows between first and last period of both; `RecordingError` for gaps or none."""
        common = self._poses.keys() & self._inputs.keys()
        if len(common) < 2:
            raise RecordingError("nothing was recorded: no poses, or no commands")
        first, last = min(common), max(common)
        rows = np.arange(first, last + 1)
        poses = self._rows_of(self._poses.keys(), rows, "poses")
        inputs = self._rows_of(self._inputs.keys(), rows, "commands")
        yaw = np.unwrap([self._poses[row].yaw_rad for row in poses])
        position = np.array([self._poses[row].position_m for row in poses])
        tilts = [self._poses[row].tilt for row in poses]
        measured = [tilt for tilt in tilts if tilt is not None]
        tilt = interpolated(rows, poses, np.array(measured)) if len(measured) == len(tilts) else None
        # Sticks are held until the next ones come.
        held = np.searchsorted(inputs, rows, side="right") - 1
        sent = np.array([self._inputs[int(inputs[index])] for index in held])
        return FlightRecording(
            self._kind,
            self._period_s,
            interpolated(rows, poses, position),
            np.interp(rows, poses, yaw),
            tilt,
            sent,
        )

    def _rows_of(self, known: Iterable[int], rows: NDArray[np.int64], what: str) -> NDArray[np.int64]:
        found = np.array(sorted(row for row in known if rows[0] <= row <= rows[-1]))
        longest_s = float(np.diff(found).max() - 1) * self._period_s
        if longest_s > LONGEST_GAP_S + 1e-9:
            raise RecordingError(
                f"{what} are missing for {longest_s:.2f} s, at most {LONGEST_GAP_S:g} s may be"
            )
        return found


def interpolated(places: NDArray[Any], known: NDArray[Any], values: Array) -> Array:
    """Return values at all places, interpolated linearly between known ones, shape (K, m)."""
    return np.column_stack([np.interp(places, known, column) for column in values.T])
