"""Places of vehicles that are excited at the same time, each with room around it."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from rcopterx.formation.placement import Room
from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.vehicles.state import Array, three
from rcopterx.vehicles.tuples import Three

EDGE_M: Final = 0.01  # between the reach of a vehicle and the edge of the flight volume
REACHES_M: Final = (0.25, 0.2, 0.15)  # how far vehicles that are excited together may usually move


class IdentificationError(RefusedError):
    """Vehicles cannot be excited, or their flight cannot be used; the message says why."""


def spread(places_m: Mapping[str, Three], reach_m: float, room: Room) -> dict[str, Three]:
    """Move vehicles without enough room to points of a horizontal grid that fills the flight volume.

    Heights stay. The sum of the squared distances is the smallest possible, so that ways do not cross.
    `places_m`: places of the vehicles, inertial frame. `reach_m`: how far each vehicle may move on every
    axis. Raises `IdentificationError`: the grid has fewer points than vehicles.
    """
    names, places, around = list(places_m), np.array(list(places_m.values())), room.shrunk(reach_m + EDGE_M)
    free = all(around.outside(place) is None for place in places)
    if free and _are_apart(places, _spacing_m(reach_m, room)):
        return dict(places_m)
    grid = _grid(reach_m, room)
    if len(grid) < len(names):
        raise IdentificationError(
            f"the flight volume has room for {len(grid)} excited vehicles, not for {len(names)}; "
            "identify fewer at the same time, or give a smaller --reach"
        )
    _, chosen = linear_sum_assignment(((places[:, None, :2] - grid) ** 2).sum(axis=-1))
    heights = np.clip(places[:, 2], around.min_m[2], around.max_m[2])
    return {
        name: three(np.array((*point, height)))
        for name, point, height in zip(names, grid[chosen], heights, strict=True)
    }


def _are_apart(places: Array, apart_m: float) -> bool:
    """Whether any two of some places, shape (k, 3), are so far apart along x or y."""
    gaps_m = np.abs(places[:, None, :2] - places[None, :, :2]).max(axis=-1)
    return bool((gaps_m[np.triu_indices(len(places), 1)] >= apart_m).all())


def usual_reach(count: int, room: Room) -> float:
    """Return the largest usual reach with which `count` vehicles have room; see `spread`."""
    return max((one for one in REACHES_M if len(_grid(one, room)) >= count), default=min(REACHES_M))


def _spacing_m(reach_m: float, room: Room) -> float:
    return (room.minimum_distance_m or 0.0) + 2.0 * reach_m


def _grid(reach_m: float, room: Room) -> Array:
    """Horizontal points of excited vehicles, as many as have room at any height, shape (k, 2)."""
    around = room.shrunk(reach_m + EDGE_M)
    low, high = np.array(around.min_m), np.array(around.max_m)
    if (low > high).any():
        return np.zeros((0, 2))
    counts = ((high - low)[:2] / _spacing_m(reach_m, room)).astype(int) + 1
    columns, rows = (
        np.linspace(low[axis], high[axis], count) if count > 1 else (low + high)[axis : axis + 1] / 2.0
        for axis, count in enumerate(counts)
    )
    grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    heights = (high[2], low[2], high[2])
    return grid[[around.barred(np.array([(*point, z) for z in heights])) is None for point in grid]]
