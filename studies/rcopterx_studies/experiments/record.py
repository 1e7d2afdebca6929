"""What was flown in the rig, as arrays, and the errors computed from it."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.bus.messages import LeaderLink
from rcopterx.formation.topology import station
from rcopterx.vehicles.state import YAW, Array

UNKNOWN: Final = np.full(4, np.nan)


@dataclass(frozen=True)
class VehicleRecord:
    """One vehicle, one row per control period, K rows."""

    time_s: Array  # shape (K,)
    motion: Array  # true motion state of `rcopterx.vehicles.state`, shape (K, 8)
    # first stage of the reference: x, y, z [m], yaw [rad], shape (K, 4); it belongs to the time at which the
    # command begins to act
    reference: Array
    station: Array  # `station_of` its leaders, shape (K, 4)
    inputs: Array  # commands, shape (K, 4)
    fallbacks: Mapping[str, int]  # how often each fallback was taken
    left_volume: bool  # whether the vehicle ever left the flight volume
    touchdowns: int  # how often it touched the floor

    def formation_error_m(self, from_s: float = 0.0) -> Array:
        """Norm of p_F - p_L - d with true positions at every period in which it followed, from a time on."""
        rows = (self.time_s >= from_s) & np.isfinite(self.station[:, 0])
        return np.asarray(np.linalg.norm(self.motion[rows, :3] - self.station[rows, :3], axis=1))

    def reference_error(self, from_s: float = 0.0) -> Array:
        """True x, y, z [m] and yaw [rad] less the reference's from a time on, shape (K, 4)."""
        return np.asarray((self.motion[:, : YAW + 1] - self.reference)[self.time_s >= from_s])


def station_of(following: Iterable[LeaderLink], motions: Mapping[str, Array]) -> Array:
    """Position [m] and yaw [rad] of the leaders plus the offsets, shape (4,); NaN without leaders.

    `motions`: motion states, or their first four numbers, of the leaders by name.
    """
    links = tuple(following)
    return station(links, [motions[link.leader][:4] for link in links]) if links else UNKNOWN


class FlightRecord(dict[str, VehicleRecord]):
    """All vehicles of a flight by name."""

    def formation_error_m(self, from_s: float = 0.0) -> Array:
        """Errors of all followers one after the other."""
        return np.concatenate([vehicle.formation_error_m(from_s) for vehicle in self.values()])

    def gap_error_m(self, first: str, second: str, from_s: float = 0.0) -> Array:
        """Norm of the error of the distance between two followers, which no controller regulates."""
        one, two = self[first], self[second]
        rows = one.time_s >= from_s
        gap = (two.motion - one.motion)[rows, :3]
        wanted = (two.station - one.station)[rows, :3]
        return np.asarray(np.linalg.norm(gap - wanted, axis=1))

    def fallbacks(self) -> Counter[str]:
        """Fallbacks of all vehicles together."""
        return sum((Counter(vehicle.fallbacks) for vehicle in self.values()), Counter[str]())


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def rms_and_max_mm(errors_m: Array, digits: int = 2) -> dict[str, float]:
    """Root mean square and largest error, rounded [mm]."""
    return {
        "rms_mm": round(1000 * rms(errors_m), digits),
        "max_mm": round(1000 * float(errors_m.max()), digits),
    }
