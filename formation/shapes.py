"""Shapes of formations: places of followers beside their leader."""

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from typing import Final, Literal

import numpy as np

from rcopterx.bus.message import Place
from rcopterx.bus.messages import LeaderLink
from rcopterx.vehicles.state import Array

ShapeName = Literal["line", "column", "wedge", "ring"]


def _sides_m(count: int, spacing_m: float) -> list[float]:
    """Distances to the left and to the right in turn."""
    return [spacing_m * (index // 2 + 1) * (-1) ** index for index in range(count)]


def _ring(count: int, spacing_m: float) -> list[Place]:
    """Leader in the middle, followers around it, neighbours and leader at least `spacing_m` apart."""
    radius_m = max(spacing_m, spacing_m / (2.0 * math.sin(math.pi / count))) if count > 1 else spacing_m
    angles = (2.0 * math.pi * index / count for index in range(count))
    return [(radius_m * math.cos(angle), radius_m * math.sin(angle), 0.0) for angle in angles]


SHAPES: Final[Mapping[str, Callable[[int, float], list[Place]]]] = {
    "line": lambda count, spacing_m: [(0.0, y, 0.0) for y in _sides_m(count, spacing_m)],
    "column": lambda count, spacing_m: [(-spacing_m * (index + 1), 0.0, 0.0) for index in range(count)],
    "wedge": lambda count, spacing_m: [
        (-abs(y), y, 0.0) for y in _sides_m(count, spacing_m / math.sqrt(2.0))
    ],
    "ring": _ring,
}


def assigned(present_m: Array, places_m: Array) -> list[int]:
    """Return the index of the place of each vehicle; present and new places have the shape (n, 3).

    The longest way is as short as possible, then the sum of the ways: linear assignments without longer ways.
    """
    # Numerical libraries take longer to import than the rest of the page.
    from scipy.optimize import linear_sum_assignment

    ways_m = np.linalg.norm(present_m[:, None] - places_m[None], axis=2)
    longer = 1.0 + ways_m.sum()  # costs more than any assignment without it

    def given(longest_m: float) -> list[int]:
        return list(map(int, linear_sum_assignment(np.where(ways_m <= longest_m, ways_m, longer))[1]))

    def possible(longest_m: float) -> bool:
        return all(ways_m[index, place] <= longest_m for index, place in enumerate(given(longest_m)))

    lengths_m = np.unique(ways_m).tolist()
    return given(lengths_m[bisect_left(lengths_m, True, key=possible)]) if lengths_m else []


def formation_links(
    shape: str, leader: str, followers: Sequence[str], spacing_m: float, present_m: Array | None = None
) -> dict[str, LeaderLink]:
    """Return links of a formation of `SHAPES`, `spacing_m` apart; offsets turn with the leader.

    Followers get places in order, or as `assigned` from their present ones beside the leader, shape (n, 3).
    """
    places = SHAPES[shape](len(followers), spacing_m)
    if present_m is not None:
        places = [places[index] for index in assigned(present_m, np.array(places).reshape(-1, 3))]
    return {
        name: LeaderLink(leader=leader, offset_m=place, frame="heading")
        for name, place in zip(followers, places, strict=True)
    }
