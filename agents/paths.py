"""Trajectories to fly: circle, figure-eight, spiral, and smooth curves through timed waypoints.

A path is a table of knots: the time, position and heading, their rates and their accelerations. Between knots
it is the quintic polynomial that agrees with both. The model is differentially flat in x, y, z and yaw, so a
path says everything about the inputs that fly it, too. All generators start and end at rest.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from agents.trajectory import COLUMNS, YAW
from vehicles.model import Model
from vehicles.state import Array, heading_matrix

KNOT_COLUMNS: Final = 1 + COLUMNS
MAX_KNOTS: Final = 600
RUN_IN_SPEED_M_S: Final = 0.5
RUN_IN_TURN_RAD_S: Final = 1.5
HEADINGS: Final = ("fixed", "along", "center")
_KNOT_SPACING_S: Final = 0.05
_CHECKED_EVERY_S: Final = 0.02

Three = tuple[float, float, float]


class PathError(ValueError):
    """A path that cannot be built or flown; the text says where and what is allowed."""


@dataclass(frozen=True)
class FlightPath:
    """A trajectory in time.

    Attributes
    ----------
    knots
        Shape (n, 13), n from 2 to 600: time [s] from 0 on, x, y, z [m], yaw [rad], their first and their
        second derivatives; inertial frame.
    """

    knots: Array

    @property
    def duration_s(self) -> float:
        """Time from the first knot to the last."""
        return float(self.knots[-1, 0])

    def sample(self, at_s: Array) -> Array:
        """Rows of a trajectory at some times, shape (k, 12); before and after, the ends are held at rest."""
        knots = self.knots
        time = np.clip(at_s, 0.0, self.duration_s)
        right = np.clip(np.searchsorted(knots[:, 0], time, side="right"), 1, len(knots) - 1)
        before, after = knots[right - 1], knots[right]
        span = (after[:, 0] - before[:, 0])[:, None]
        s = (time - before[:, 0])[:, None] / span
        samples = quintic(before[:, 1:], after[:, 1:], span, s)
        samples[(at_s < 0.0) | (at_s > self.duration_s), 4:] = 0.0
        return samples


def circle(
    center_m: Three, radius_m: float, period_s: float, turns: float = 1.0, heading: str = "fixed"
) -> FlightPath:
    """Circle around a center, counter-clockwise; negative turns fly it clockwise."""
    return spiral(center_m, (radius_m, radius_m), 0.0, period_s, turns, heading)


def spiral(
    center_m: Three,
    radii_m: tuple[float, float],
    climb_m: float,
    period_s: float,
    turns: float = 2.0,
    heading: str = "fixed",
) -> FlightPath:
    """Spiral: radius and height change evenly with the angle.

    Parameters
    ----------
    center_m
        Center at the start.
    radii_m
        Radius at the start and at the end.
    climb_m
        Height gained on the way.
    period_s
        Time of a turn at full speed.
    turns
        Number of turns, not zero.
    heading
        `fixed` at zero, `along` the path or towards the `center`.

    Raises
    ------
    PathError
        A parameter is out of range.
    """
    _positive(radius_m=max(radii_m), period_s=period_s)
    whole = math.tau * turns

    def curve(angle: Array) -> Array:
        share = angle / whole
        radius = radii_m[0] + (radii_m[1] - radii_m[0]) * share
        return np.column_stack(
            (
                center_m[0] + radius * np.cos(angle),
                center_m[1] + radius * np.sin(angle),
                center_m[2] + climb_m * share,
            )
        )

    return _along(curve, whole, period_s, heading, center_m)


def figure_eight(
    center_m: Three, size_m: tuple[float, float], period_s: float, turns: float = 1.0, heading: str = "fixed"
) -> FlightPath:
    """Figure-eight (Gerono's lemniscate): `size_m` is its half-width along x and y.

    Raises
    ------
    PathError
        A parameter is out of range.
    """
    _positive(size_m=min(size_m), period_s=period_s)

    def curve(angle: Array) -> Array:
        return np.column_stack(
            (
                center_m[0] + size_m[0] * np.sin(angle),
                center_m[1] + size_m[1] * np.sin(2 * angle),
                np.full(len(angle), center_m[2]),
            )
        )

    return _along(curve, math.tau * turns, period_s, heading, center_m)


def through(waypoints: Sequence[Sequence[float]]) -> FlightPath:
    """Smooth curve through timed waypoints, at rest at both ends.

    Parameters
    ----------
    waypoints
        Rows of time [s], x, y, z [m] and yaw [rad]; times increase. A quintic spline passes through all of
        them, so that even the jerk is continuous.

    Raises
    ------
    PathError
        Fewer than two rows, wrong columns, numbers that are not finite, or times that do not increase.
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
    spline = _spline_at_rest(table[:, 0], table[:, 1:])
    times = _knot_times(float(table[-1, 0] - table[0, 0])) + table[0, 0]
    parts = [spline(times), spline.derivative(1)(times), spline.derivative(2)(times)]
    return FlightPath(np.column_stack((times - table[0, 0], *parts)))


def begun_from(path: FlightPath, present: Array, run_in_s: float) -> FlightPath:
    """FlightPath with a smooth way to its beginning.

    Parameters
    ----------
    path
        The path.
    present
        Row of the present reference, shape (12,).
    run_in_s
        Time for the way.
    """
    knots = path.knots.copy()
    turns = round((present[YAW] - knots[0, 1 + YAW]) / math.tau)
    knots[:, 1 + YAW] += math.tau * turns
    knots[:, 0] += run_in_s
    return FlightPath(np.vstack((np.concatenate(([0.0], present)), knots)))


def run_in_time_s(path: FlightPath, present: Array) -> float:
    """Time for a smooth way from the present reference, shape (12,), to the beginning of a path."""
    first = path.knots[0, 1:5]
    way_m = float(np.linalg.norm(first[:3] - present[:3]))
    turn_rad = abs(math.remainder(float(first[3] - present[YAW]), math.tau))
    speed = float(np.linalg.norm(present[4:7])) / RUN_IN_SPEED_M_S
    return max(1.0, 1.875 * way_m / RUN_IN_SPEED_M_S, 1.875 * turn_rad / RUN_IN_TURN_RAD_S, 2.0 * speed)


def path_problem(path: FlightPath, model: Model, low_m: Three, high_m: Three) -> str | None:
    """Where a path leaves the volume or asks too much of a vehicle; None if it can be flown.

    Parameters
    ----------
    path
        The path, run-in included.
    model
        The vehicle: its bounds of speed, and inputs that must suffice for the accelerations.
    low_m, high_m
        Flight volume.
    """
    times = np.arange(0.0, path.duration_s + _CHECKED_EVERY_S, _CHECKED_EVERY_S)
    samples = path.sample(times)
    for axis, name in enumerate("xyz"):
        outside = (samples[:, axis] < low_m[axis] - 1e-6) | (samples[:, axis] > high_m[axis] + 1e-6)
        if outside.any():
            at = int(np.argmax(outside))
            return (
                f"at {times[at]:.2f} s {name} is {samples[at, axis]:.2f} m, outside the flight volume "
                f"{low_m[axis]:g} .. {high_m[axis]:g} m"
            )
    to_body = np.stack([heading_matrix(float(yaw)).T for yaw in samples[:, YAW]])
    rate, acceleration = samples[:, 4:8].copy(), samples[:, 8:12].copy()
    rate[:, :2] = (to_body @ samples[:, 4:6, None])[:, :, 0]
    acceleration[:, :2] = (to_body @ samples[:, 8:10, None])[:, :, 0]
    allowed = np.minimum(-np.array(model.state_min)[3:7], np.array(model.state_max)[3:7])
    up, down = model.u_max - model.hover_input, model.hover_input - model.u_min
    reach = np.abs(model.b) * np.minimum(up, down)
    for what, used, slower in (
        (("speed forward", "speed sideways", "climb", "yaw rate"), np.abs(rate) / allowed, 1.0),
        (
            ("pitch", "roll", "thrust", "yaw input"),
            np.abs(acceleration - model.k * rate) / reach,
            0.5,
        ),
    ):
        if used.max() > 1.0:
            at, axis = divmod(int(np.argmax(used)), used.shape[1])
            factor = float(used.max()) ** slower
            return (
                f"at {times[at]:.2f} s {what[axis]} would have to be {100 * used[at, axis]:.0f} % of what "
                f"the vehicle can; {factor:.2f} times as slow it could be flown"
            )
    return None


def _along(
    curve: Callable[[Array], Array], whole_rad: float, period_s: float, heading: str, center_m: Three
) -> FlightPath:
    """Fly a curve of an angle with even speed, gently started and stopped."""
    if heading not in HEADINGS:
        raise PathError(f"heading: {heading!r} is not one of {', '.join(HEADINGS)}")
    if not 0.1 <= abs(whole_rad) / math.tau <= 100:
        raise PathError(f"turns: {whole_rad / math.tau:g} is not from 0.1 to 100 (or -0.1 to -100)")
    speed = math.tau / period_s
    ramp_s = min(0.5 * period_s, abs(whole_rad) / speed)
    duration_s = abs(whole_rad) / speed + ramp_s
    times = _knot_times(duration_s)
    angle = math.copysign(speed, whole_rad) * _eased(times, ramp_s, duration_s)
    step = 1e-4
    spread = np.array([_eased(times + shift * step, ramp_s, duration_s) for shift in (-1, 0, 1)])
    rate = math.copysign(speed, whole_rad) * (spread[2] - spread[0]) / (2 * step)
    acceleration = math.copysign(speed, whole_rad) * (spread[2] - 2 * spread[1] + spread[0]) / step**2
    first = (curve(angle + step) - curve(angle - step)) / (2 * step)
    second = (curve(angle + step) - 2 * curve(angle) + curve(angle - step)) / step**2
    knots = np.zeros((len(times), KNOT_COLUMNS))
    knots[:, 0] = times
    knots[:, 1:4] = curve(angle)
    knots[:, 5:8] = first * rate[:, None]
    knots[:, 9:12] = second * (rate**2)[:, None] + first * acceleration[:, None]
    knots[[0, -1], 5:] = 0.0
    if heading != "fixed":
        towards = first * math.copysign(1.0, whole_rad) if heading == "along" else center_m - knots[:, 1:4]
        yaw = np.unwrap(np.arctan2(towards[:, 1], towards[:, 0]))
        spline = _spline_at_rest(times, yaw[:, None])
        knots[:, 4] = yaw
        knots[:, 8], knots[:, 12] = (spline.derivative(order)(times)[:, 0] for order in (1, 2))
    return FlightPath(knots)


def _spline_at_rest(times: Array, values: Array) -> BSpline:
    """Quintic spline through rows of values, with zero rate and acceleration at both ends."""
    zeros = np.zeros(values.shape[1])
    ends: Any = [(1, zeros), (2, zeros)]
    return make_interp_spline(times, values, k=5, bc_type=(ends, ends))


def _eased(times: Array, ramp_s: float, duration_s: float) -> Array:
    """Time that passes on the curve: at rest outside, even speed in the middle, smooth ramps between."""

    def risen(t: Array) -> Array:
        s = np.clip(t / ramp_s, 0.0, 1.0)
        return ramp_s * s**4 * (2.5 - 3.0 * s + s**2) + np.maximum(t - ramp_s, 0.0)

    return np.asarray(risen(times) - risen(times - (duration_s - ramp_s)))


def _knot_times(duration_s: float) -> Array:
    count = int(np.clip(math.ceil(duration_s / _KNOT_SPACING_S) + 1, 2, MAX_KNOTS - 1))
    return np.linspace(0.0, duration_s, count)


def quintic(before: Array, after: Array, span: Array, s: Array) -> Array:
    """Quintic Hermite interpolation.

    Parameters
    ----------
    before, after
        Rows of four values, their rates and their accelerations at both ends, shape (k, 12).
    span, s
        Time between the ends, and the fraction of it that has passed, shape (k, 1).

    Returns
    -------
    Array
        Rows of the same kind, shape (k, 12).
    """
    p0, v0, a0 = before[:, :4], before[:, 4:8] * span, before[:, 8:] * span**2
    p1, v1, a1 = after[:, :4], after[:, 4:8] * span, after[:, 8:] * span**2
    gap = p1 - p0 - v0 - 0.5 * a0
    slope, bend = v1 - v0 - a0, a1 - a0
    c3, c4, c5 = (
        10 * gap - 4 * slope + 0.5 * bend,
        -15 * gap + 7 * slope - bend,
        6 * gap - 3 * slope + 0.5 * bend,
    )
    value = p0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    rate = v0 + s * (a0 + s * (3 * c3 + s * (4 * c4 + 5 * s * c5)))
    acceleration = a0 + s * (6 * c3 + s * (12 * c4 + 20 * s * c5))
    return np.column_stack((value, rate / span, acceleration / span**2))


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise PathError(f"{name} must be above 0, got {value:g}")
