"""Places at which vehicles are excited at the same time without meeting."""

from collections.abc import Mapping
from itertools import combinations
from typing import Final

import numpy as np

from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx.vehicles.state import Array, three
from rcopterx.vehicles.tuples import Three

EDGE_M: Final = 0.01
"""Between the reach of a vehicle and the edge of the flight volume."""
ABOVE_M: Final = 0.05
"""Vehicles that are horizontally closer are above each other."""


class IdentificationError(RefusedError):
    """Vehicles cannot be excited, or their flight cannot be used; the message says why."""


def spread(
    places_m: Mapping[str, Three], reach_m: float, distance_m: float, volume_m: tuple[Three, Three]
) -> dict[str, Three]:
    """Enlarge a formation horizontally until all vehicles can move, and keep it in the flight volume.

    Parameters
    ----------
    places_m
        Places of the vehicles, inertial frame.
    reach_m
        How far each vehicle may move on every axis.
    distance_m
        Horizontal distance that is left between two of them then.
    volume_m
        Lowest and highest corner of the flight volume.

    Raises
    ------
    IdentificationError
        A vehicle is above another one, or the enlarged formation does not fit into the volume.
    """
    names, places = list(places_m), np.array(list(places_m.values()))
    factor = 1.0
    for first, second in combinations(range(len(names)), 2):
        apart_m = float(np.abs(places[first, :2] - places[second, :2]).max())
        if apart_m < ABOVE_M:
            raise IdentificationError(
                f"{names[first]} and {names[second]} are above each other; move one of them"
            )
        factor = max(factor, (distance_m + 2.0 * reach_m) / apart_m)
    wide = places.copy()
    wide[:, :2] = places[:, :2].mean(axis=0) + factor * (places[:, :2] - places[:, :2].mean(axis=0))
    wide += _shift_into(wide, np.array(volume_m), reach_m + EDGE_M)
    return {name: three(place) for name, place in zip(names, wide, strict=True)}


def _shift_into(places: Array, volume: Array, margin_m: float) -> Array:
    """Return the smallest shift of places, shape (k, 3), that leaves a margin to the edges, shape (3,)."""
    low, high = volume[0] + margin_m - places.min(axis=0), volume[1] - margin_m - places.max(axis=0)
    if (low > high).any():
        missing_m = float((low - high).max())
        raise IdentificationError(
            f"the flight volume is {missing_m:.2f} m too small for {len(places)} vehicles at the same time; "
            "identify fewer, or give a smaller --reach"
        )
    return np.clip(np.zeros(3), low, high)
