"""Paths of a shape: circle, figure-eight, spiral, and smooth curves through timed waypoints.

All of them start and end at rest, and raise `PathError` for parameters out of range. The client builds them;
agents receive only their knots and need no splines.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from scipy.interpolate import make_interp_spline

from rcopterx.control.references.paths import MAX_KNOTS, FlightPath, PathError
from rcopterx.vehicles.state import Array
from rcopterx.vehicles.tuples import Three

HEADINGS: Final = ("fixed", "along", "center")
_KNOT_SPACING_S: Final = 0.05
_SMALL_RAD: Final = 1e-4


def circle(
    center_m: Three, radius_m: float, period_s: float, turns: float = 1.0, heading: str = "fixed"
) -> FlightPath:
    """Return a counter-clockwise circle around a center; negative turns are clockwise."""
    return spiral(center_m, (radius_m, radius_m), 0.0, period_s, turns, heading)


def spiral(
    center_m: Three,
    radii_m: tuple[float, float],
    climb_m: float,
    period_s: float,
    turns: float = 2.0,
    heading: str = "fixed",
) -> FlightPath:
    """Return a spiral: radius and height change linearly with the angle.

    `radii_m`: radius at the start and at the end. `period_s`: time of a turn at full speed. `turns`: number
    of turns, not zero. `heading`: `fixed` at zero, `along` the path or towards the `center`.
    """
    _positive(radius_m=max(radii_m), period_s=period_s)
    whole = math.tau * turns

    def curve(angle: Array) -> Array:
        share = angle / whole
        radius = radii_m[0] + (radii_m[1] - radii_m[0]) * share
        return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), climb_m * share))

    return _along(curve, whole, period_s, heading, center_m)


def figure_eight(
    center_m: Three, size_m: tuple[float, float], period_s: float, turns: float = 1.0, heading: str = "fixed"
) -> FlightPath:
    """Return a figure-eight (Gerono's lemniscate); `size_m` is its half-width along x and y."""
    _positive(size_m=min(size_m), period_s=period_s)

    def curve(angle: Array) -> Array:
        return np.column_stack((size_m[0] * np.sin(angle), size_m[1] * np.sin(2 * angle), 0.0 * angle))

    return _along(curve, math.tau * turns, period_s, heading, center_m)


def through(waypoints: Sequence[Sequence[float]] | Array, whole_turns: bool = False) -> FlightPath:
    """Return a quintic spline through timed waypoints, at rest at both ends.

    Rows of `waypoints` are time [s], x, y, z [m] and yaw [rad]; times increase. From one row to the next the
    vehicle turns the nearest way, unless headings count `whole_turns`.
    """
    table = np.array([list(row) for row in waypoints], dtype=float) if len(waypoints) else np.zeros((0, 5))
    if table.ndim != 2 or table.shape[1] != 5 or len(table) < 2:
        raise PathError("waypoints: at least two rows of time, x, y, z, yaw are needed")
    if not np.isfinite(table).all():
        raise PathError("waypoints: every number must be finite")
    late = np.flatnonzero(np.diff(table[:, 0]) <= 0)
    if len(late):
        raise PathError(
            f"waypoints: time {table[late[0] + 1, 0]:g} s does not come after {table[late[0], 0]:g} s"
        )
    if not whole_turns:
        table[:, 4] = np.unwrap(table[:, 4])
    at_rest: Any = [(order, np.zeros(4)) for order in (1, 2)]  # rates and accelerations at both ends
    spline = make_interp_spline(table[:, 0], table[:, 1:], k=5, bc_type=(at_rest, at_rest))
    times = _knot_times(float(table[-1, 0] - table[0, 0])) + table[0, 0]
    parts = [spline(times), spline.derivative(1)(times), spline.derivative(2)(times)]
    return FlightPath(np.column_stack((times - table[0, 0], *parts)))


def _along(
    curve: Callable[[Array], Array], whole_rad: float, period_s: float, heading: str, center_m: Three
) -> FlightPath:
    """Fly a curve about a center, by an angle, at constant speed, with smooth ramps at both ends."""
    if heading not in HEADINGS:
        raise PathError(f"heading: {heading!r} is not one of {', '.join(HEADINGS)}")
    if not 0.1 <= abs(whole_rad) / math.tau <= 100:
        raise PathError(f"turns: {whole_rad / math.tau:g} is not from 0.1 to 100 (or -0.1 to -100)")
    speed = math.tau / period_s
    ramp_s = min(0.5 * period_s, abs(whole_rad) / speed)
    duration_s = abs(whole_rad) / speed + ramp_s
    times = _knot_times(duration_s)
    angle = math.copysign(speed, whole_rad) * _eased(times, ramp_s, duration_s)
    arms, yaw_rad = curve(angle), np.zeros(len(times))
    if heading != "fixed":
        ahead = curve(angle + _SMALL_RAD) - curve(angle - _SMALL_RAD)
        towards = math.copysign(1.0, whole_rad) * ahead if heading == "along" else -arms
        yaw_rad = np.unwrap(np.arctan2(towards[:, 1], towards[:, 0]))
    return through(np.column_stack((times, np.array(center_m) + arms, yaw_rad)))


def _eased(times: Array, ramp_s: float, duration_s: float) -> Array:
    """Time that passes on the curve: at rest outside, constant speed in the middle, smooth ramps between."""

    def risen(t: Array) -> Array:
        s = np.clip(t / ramp_s, 0.0, 1.0)
        return ramp_s * s**4 * (2.5 - 3.0 * s + s**2) + np.maximum(t - ramp_s, 0.0)

    return np.asarray(risen(times) - risen(times - (duration_s - ramp_s)))


def _knot_times(duration_s: float) -> Array:
    count = int(np.clip(math.ceil(duration_s / _KNOT_SPACING_S) + 1, 2, MAX_KNOTS - 1))
    return np.linspace(0.0, duration_s, count)


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise PathError(f"{name} must be above 0, got {value:g}")
