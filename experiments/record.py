"""What was flown in the rig, as arrays, and the errors computed from it."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.agents.pilot import ControlOutput
from rcopterx.simulator.plant import Plant
from rcopterx.vehicles.state import YAW, Array

_UNKNOWN: Final = np.full(4, np.nan)


@dataclass(frozen=True)
class VehicleRecord:
    """One vehicle, one row per control period, K rows.

    Attributes
    ----------
    time_s
        Shape (K,).
    motion
        True motion state of `rcopterx.vehicles.state`, shape (K, 8).
    reference
        First stage of the reference: x, y, z [m], yaw [rad], shape (K, 4). It belongs to the time at which
        the command begins to act.
    station
        True position [m] and yaw [rad] of the leaders plus the present offset, shape (K, 4); NaN where the
        vehicle does not follow.
    inputs
        Commands, shape (K, 4).
    fallbacks
        How often each fallback was taken.
    left_volume, touchdowns
        Whether the vehicle ever left the flight volume; how often it touched the floor.
    """

    time_s: Array
    motion: Array
    reference: Array
    station: Array
    inputs: Array
    fallbacks: Mapping[str, int]
    left_volume: bool
    touchdowns: int

    def formation_error_m(self, from_s: float = 0.0) -> Array:
        """Norm of p_F - p_L - d with true positions at every period in which it followed, from a time on."""
        rows = (self.time_s >= from_s) & np.isfinite(self.station[:, 0])
        return np.asarray(np.linalg.norm(self.motion[rows, :3] - self.station[rows, :3], axis=1))

    def reference_error(self, from_s: float = 0.0) -> Array:
        """True x, y, z [m] and yaw [rad] less the reference's from a time on, shape (K, 4)."""
        return np.asarray((self.motion[:, : YAW + 1] - self.reference)[self.time_s >= from_s])


class Recorder:
    """Collects the rows of one vehicle."""

    def __init__(self) -> None:
        self._rows: list[tuple[object, ...]] = []

    def add(
        self, time_s: float, motion: tuple[float, ...], flight: ControlOutput, station: Array | None
    ) -> None:
        """Add a control period."""
        self._rows.append(
            (
                time_s,
                motion,
                _UNKNOWN if flight.reference is None else flight.reference.copy(),
                _UNKNOWN if station is None else station,
                flight.input,
            )
        )

    def record(self, fallbacks: Mapping[str, int], plant: Plant) -> VehicleRecord:
        """Everything collected, as arrays."""
        time_s, motion, reference, station, inputs = (
            np.array(column, dtype=float) for column in zip(*self._rows, strict=True)
        )
        return VehicleRecord(
            time_s, motion, reference, station, inputs, Counter(fallbacks), plant.left_volume,
            plant.touchdowns,
        )  # fmt: skip


@dataclass(frozen=True)
class FlightRecord:
    """All vehicles of a flight by name."""

    vehicles: Mapping[str, VehicleRecord]

    def __getitem__(self, name: str) -> VehicleRecord:
        """Record of one vehicle."""
        return self.vehicles[name]

    def formation_error_m(self, from_s: float = 0.0) -> Array:
        """Errors of all followers one after the other."""
        return np.concatenate([vehicle.formation_error_m(from_s) for vehicle in self.vehicles.values()])

    def gap_error_m(self, first: str, second: str, from_s: float = 0.0) -> Array:
        """Norm of the error of the distance between two followers, which no controller regulates."""
        one, two = self.vehicles[first], self.vehicles[second]
        rows = one.time_s >= from_s
        gap = (two.motion - one.motion)[rows, :3]
        wanted = (two.station - one.station)[rows, :3]
        return np.asarray(np.linalg.norm(gap - wanted, axis=1))

    def fallbacks(self) -> Counter[str]:
        """Fallbacks of all vehicles together."""
        total: Counter[str] = Counter()
        for vehicle in self.vehicles.values():
            total.update(vehicle.fallbacks)
        return total


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def rms_and_max_mm(errors_m: Array, digits: int = 2) -> dict[str, float]:
    """Root mean square and largest error, rounded [mm]."""
    return {
        "rms_mm": round(1000 * rms(errors_m), digits),
        "max_mm": round(1000 * float(errors_m.max()), digits),
    }
