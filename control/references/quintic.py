"""Quintic polynomials: smooth from one state to another, or from rest to rest."""

from typing import Final

import numpy as np

from rcopterx.control.references.columns import ACCELERATIONS, POSE, RATES
from rcopterx.vehicles.state import Array

PEAK_TO_MEAN_SPEED: Final = 1.875  # ratio of the peak to the mean speed from rest to rest


def rest_to_rest(begin: Array, end: Array, s: Array, duration_s: float) -> tuple[Array, Array, Array]:
    """Quintic from rest to rest between values (m,) at shares `s` (k, 1): values, rates, accelerations."""
    span = end - begin
    return (
        begin + span * s**3 * (10 + s * (6 * s - 15)),
        span * 30 * s**2 * (1 - s) ** 2 / duration_s,
        span * 60 * s * (1 - s) * (1 - 2 * s) / duration_s**2,
    )


def quintic(before: Array, after: Array, span: Array, s: Array) -> Array:
    """Quintic Hermite interpolation to rows (k, 12) between such rows, `span` apart, at the shares `s`."""
    p0, v0, a0 = before[:, POSE], before[:, RATES] * span, before[:, ACCELERATIONS] * span**2
    c3, c4, c5 = _powers(before, after, span)
    value = p0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    rate = v0 + s * (a0 + s * (3 * c3 + s * (4 * c4 + 5 * s * c5)))
    acceleration = a0 + s * (6 * c3 + s * (12 * c4 + 20 * s * c5))
    return np.column_stack((value, rate / span, acceleration / span**2))


def quintic_jerk(before: Array, after: Array, span: Array, s: Array) -> Array:
    """Return the third derivatives of `quintic`, shape (k, 4)."""
    c3, c4, c5 = _powers(before, after, span)
    return np.asarray((6 * c3 + s * (24 * c4 + 60 * s * c5)) / span**3)


def _powers(before: Array, after: Array, span: Array) -> tuple[Array, Array, Array]:
    """Coefficients of the third to the fifth power of the share of the time."""
    p0, v0, a0 = before[:, POSE], before[:, RATES] * span, before[:, ACCELERATIONS] * span**2
    p1, v1, a1 = after[:, POSE], after[:, RATES] * span, after[:, ACCELERATIONS] * span**2
    gap = p1 - p0 - v0 - 0.5 * a0
    slope, bend = v1 - v0 - a0, a1 - a0
    return (10 * gap - 4 * slope + 0.5 * bend, -15 * gap + 7 * slope - bend, 6 * gap - 3 * slope + 0.5 * bend)
