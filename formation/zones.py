"""Ways and keep-out zones: boxes and upright cylinders."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rcopterx.bus.messages import Zone
from rcopterx.vehicles.state import Array

EVERY_M: Final = 0.01  # between places that are tried, on the straight lines between those of a way
TINY_M: Final = 1e-6  # a way that only touches a zone does not enter it


def after_leaving(within: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which of these places count, of a way that may begin so, but has to end otherwise."""
    counted: NDArray[np.bool_] = within & ~np.append(np.logical_and.accumulate(within)[:-1], False)
    return counted


def entered(zone: Zone, way_m: Array) -> Array | None:
    """Return where, shape (3,), a way, shape (k, 3), enters a zone with its margin; None if it does not."""
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
    inside = after_leaving(np.all(beside_m < (high_m - low_m) / 2, axis=1))
    return places_m[np.argmax(inside)] if inside.any() else None
