"""Formations by name: places of followers beside one leader."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from rcopterx.bus.messages import LeaderLink

Place = tuple[float, float, float]


def _line(count: int, spacing_m: float) -> list[Place]:
    sides = (((index // 2) + 1) * (1 if index % 2 == 0 else -1) for index in range(count))
    return [(0.0, spacing_m * side, 0.0) for side in sides]


def _ring(count: int, spacing_m: float) -> list[Place]:
    """Leader in the middle, followers around it, neighbours and leader at least `spacing_m` apart."""
    radius_m = max(spacing_m, spacing_m / (2.0 * math.sin(math.pi / count))) if count > 1 else spacing_m
    angles = (2.0 * math.pi * index / count for index in range(count))
    return [(radius_m * math.cos(angle), radius_m * math.sin(angle), 0.0) for angle in angles]


SHAPES: Final[Mapping[str, Callable[[int, float], list[Place]]]] = {
    "line": _line,
    "column": lambda count, spacing_m: [(-spacing_m * (index + 1), 0.0, 0.0) for index in range(count)],
    "wedge": lambda count, spacing_m: [
        (-abs(y), y, 0.0) for _, y, _ in _line(count, spacing_m / math.sqrt(2.0))
    ],
    "ring": _ring,
}


def formation_links(
    shape: str, leader: str, followers: Sequence[str], spacing_m: float
) -> dict[str, LeaderLink]:
    """Links of a formation of `SHAPES`, `spacing_m` apart, in order; offsets turn with the leader."""
    places = SHAPES[shape](len(followers), spacing_m)
    return {
        name: LeaderLink(leader=leader, offset_m=place, frame="heading")
        for name, place in zip(followers, places, strict=True)
    }
