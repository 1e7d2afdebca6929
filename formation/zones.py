"""Ways and keep-out zones: boxes and upright cylinders."""

from typing import Final

import numpy as np

from rcopterx.bus.messages import Zone
from rcopterx.vehicles.state import Array

EVERY_M: Final = 0.01  # between places of a way that are tried
TINY_M: Final = 1e-6  # a way that only touches a zone does not enter it


def entered(zone: Zone, way_m: Array) -> Array | None:
    """Return where a way, shape (k, 3), enters a zone with its margin, shape (3,); None if it does not.

    The way is straight between its places. It may begin in the zone, but has to leave it, for good.
    """
    margin_m = zone.margin_m - TINY_M
    low_m, high_m = np.array(zone.min_m) - margin_m, np.array(zone.max_m) + margin_m
    if np.any(way_m.max(axis=0) < low_m) or np.any(way_m.min(axis=0) > high_m):
        return None  # most ways, at once: a leader tries those of all followers within a control period
    passed_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(way_m, axis=0), axis=1)))
    along_m = np.linspace(0.0, passed_m[-1], 2 + int(passed_m[-1] / EVERY_M))
    places_m = np.column_stack([np.interp(along_m, passed_m, axis_m) for axis_m in way_m.T])
    beside_m = np.abs(places_m - (low_m + high_m) / 2)
    if zone.shape == "cylinder":
        beside_m[:, :2] = np.linalg.norm(beside_m[:, :2], axis=1, keepdims=True)
    inside = np.all(beside_m < (high_m - low_m) / 2, axis=1)
    inside &= ~np.append(np.logical_and.accumulate(inside)[:-1], False)
    return places_m[np.argmax(inside)] if inside.any() else None
