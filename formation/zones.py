"""Ways and keep-out zones: boxes and upright cylinders."""

from typing import Final

import numpy as np

from rcopterx.bus.messages import Zone
from rcopterx.vehicles.state import Array

TINY_M: Final = 1e-6  # a way that only touches a zone does not enter it


def entered(zone: Zone, way_m: Array) -> Array | None:
    """Return where a way, shape (k, 3), enters a zone with its margin, shape (3,); None if it does not.

    The way is straight between its places. It may begin in the zone, but has to leave it, for good.
    """
    way_m = np.vstack((way_m, way_m[-1:]))  # the last step shows whether the way ends in the zone
    begin_m, step_m = way_m[:-1], np.diff(way_m, axis=0)
    step_m = np.where(step_m == 0.0, TINY_M**2, step_m)
    margin_m = zone.margin_m - TINY_M
    low_m, high_m = np.array(zone.min_m) - margin_m, np.array(zone.max_m) + margin_m
    # Shares of each step at which it passes the bounds of each axis; it is inside between them.
    first, last = np.sort((low_m - begin_m, high_m - begin_m) / step_m, axis=0)
    if zone.shape == "cylinder":
        centre_m, radius_m = (low_m + high_m)[:2] / 2, (high_m - low_m)[0] / 2
        first[:, 0], last[:, 0] = first[:, 1], last[:, 1] = _in_disc(
            begin_m[:, :2] - centre_m, step_m[:, :2], radius_m
        )
    enters, leaves = np.maximum(first.max(axis=1), 0.0), np.minimum(last.min(axis=1), 1.0)
    inside = enters < leaves
    inside &= ~np.append(np.logical_and.accumulate(inside & (enters == 0.0))[:-1], False)
    if not inside.any():
        return None
    step = int(np.argmax(inside))
    return np.asarray(begin_m[step] + enters[step] * step_m[step])


def _in_disc(begin_m: Array, step_m: Array, radius_m: float) -> tuple[Array, Array]:
    """Return shares of steps, shape (k, 2), between which they are in a disc about 0; nan if they miss it."""
    squared, along = np.sum(step_m * step_m, axis=1), np.sum(begin_m * step_m, axis=1)
    root = along * along - squared * (np.sum(begin_m * begin_m, axis=1) - radius_m * radius_m)
    half = np.sqrt(np.where(root < 0.0, np.nan, root))
    return (-along - half) / squared, (-along + half) / squared
