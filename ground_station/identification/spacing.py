"""Places of vehicles that are excited at the same time, each with room around it."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.vehicles.state import Array, three
from rcopterx.vehicles.tuples import Three

EDGE_M: Final = 0.01  # between the reach of a vehicle and the edge of the flight volume
REACHES_M: Final = (0.25, 0.2, 0.15)  # how far vehicles that are excited together may usually move


class IdentificationError(RefusedError):
    """Vehicles cannot be excited, or their flight cannot be used; the message says why."""


def spread(
    places_m: Mapping[str, Three], reach_m: float, distance_m: float, volume_m: tuple[Three, Three]
) -> dict[str, Three]:
    """Move vehicles without enough room to points of a horizontal grid that fills the flight volume.

    Heights stay. The sum of the squared distances is the smallest possible, so that ways do not cross.
    `places_m`: places of the vehicles, inertial frame. `reach_m`: how far each vehicle may move on every
    axis. `distance_m`: distance that is left between two of them then. `volume_m`: lowest and highest corner
    of the flight volume. Raises `IdentificationError`: the grid has fewer points than vehicles.
    """
    names, places = list(places_m), np.array(list(places_m.values()))
    low, high = _corners(reach_m, volume_m)
    if (places >= low).all() and (places <= high).all() and _are_apart(places, distance_m + 2.0 * reach_m):
        return dict(places_m)
    grid = _grid(reach_m, distance_m, volume_m)
    if len(grid) < len(names):
        raise IdentificationError(
            f"the flight volume has room for {len(grid)} excited vehicles, not for {len(names)}; "
            "identify fewer at the same time, or give a smaller --reach"
        )
    _, chosen = linear_sum_assignment(((places[:, None, :2] - grid) ** 2).sum(axis=-1))
    heights = np.clip(places[:, 2], low[2], high[2])
    return {
        name: three(np.array((*point, height)))
        for name, point, height in zip(names, grid[chosen], heights, strict=True)
    }


def _are_apart(places: Array, apart_m: float) -> bool:
    """Whether any two of some places, shape (k, 3), are so far apart along x or y."""
    gaps_m = np.abs(places[:, None, :2] - places[None, :, :2]).max(axis=-1)
    return bool((gaps_m[np.triu_indices(len(places), 1)] >= apart_m).all())


def usual_reach(count: int, distance_m: float, volume_m: tuple[Three, Three]) -> float:
    """Return the largest usual reach with which `count` vehicles have room; see `spread`."""
    fitting = [one for one in REACHES_M if len(_grid(one, distance_m, volume_m)) >= count]
    return max(fitting, default=min(REACHES_M))


def _grid(reach_m: float, distance_m: float, volume_m: tuple[Three, Three]) -> Array:
    """Horizontal points of excited vehicles, as many as have room, shape (k, 2)."""
    low, high = _corners(reach_m, volume_m)
    if (low > high).any():
        return np.zeros((0, 2))
    counts = ((high - low)[:2] / (distance_m + 2.0 * reach_m)).astype(int) + 1
    columns, rows = (
        np.linspace(low[axis], high[axis], count) if count > 1 else (low + high)[axis : axis + 1] / 2.0
        for axis, count in enumerate(counts)
    )
    return np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)


def _corners(reach_m: float, volume_m: tuple[Three, Three]) -> tuple[Array, Array]:
    """Lowest and highest place of an excited vehicle, shape (3,)."""
    margin_m = reach_m + EDGE_M
    return np.array(volume_m[0]) + margin_m, np.array(volume_m[1]) - margin_m
