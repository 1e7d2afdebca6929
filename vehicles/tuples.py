"""Vectors as plain tuples, for settings and messages."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rcopterx.vehicles.state import Array

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


def three(values: "Array") -> Three:
    """Array of shape (3,) as a tuple."""
    x, y, z = values.tolist()
    return (x, y, z)


def four(values: "Array") -> Four:
    """Array of shape (4,) as a tuple."""
    a, b, c, d = values.tolist()
    return (a, b, c, d)
