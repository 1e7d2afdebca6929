"""Shapes of formations: places of followers beside their leader."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final, Literal

from rcopterx.bus.message import Place
from rcopterx.bus.messages import LeaderLink

ShapeName = Literal["line", "column", "wedge", "ring"]


def _sides_m(count: int, spacing_m: float) -> list[float]:
    """Distances to the left and to the right in turn."""
    return [spacing_m * (index // 2 + 1) * (-1) ** index for index in range(count)]


def _ring(count: int, spacing_m: float) -> list[Place]:
    """Leader in the middle, followers around it, neighbours and leader at least `spacing_m` apart."""
    radius_m = max(spacing_m, spacing_m / (2.0 * math.sin(math.pi / count))) if count > 1 else spacing_m
    angles = (2.0 * math.pi * index / count for index in range(count))
    return [(radius_m * math.cos(angle), radius_m * math.sin(angle), 0.0) for angle in angles]


SHAPES: Final[Mapping[ShapeName, Callable[[int, float], list[Place]]]] = {
    "line": lambda count, spacing_m: [(0.0, y, 0.0) for y in _sides_m(count, spacing_m)],
    "column": lambda count, spacing_m: [(-spacing_m * (index + 1), 0.0, 0.0) for index in range(count)],
    "wedge": lambda count, spacing_m: [
        (-abs(y), y, 0.0) for y in _sides_m(count, spacing_m / math.sqrt(2.0))
    ],
    "ring": _ring,
}


def formation_links(
    shape: ShapeName, leader: str, followers: Sequence[str], spacing_m: float
) -> dict[str, LeaderLink]:
    """Return links of a formation of `SHAPES`, `spacing_m` apart, in order; offsets turn with the leader."""
    places = SHAPES[shape](len(followers), spacing_m)
    return {
        name: LeaderLink(leader=leader, offset_m=place, frame="heading")
        for name, place in zip(followers, places, strict=True)
    }
