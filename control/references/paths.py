"""Trajectories in time, smooth ways to their beginning, and the check whether a vehicle can fly them.

A path is a table of knots: time, position and heading, their rates and accelerations. Between knots it is the
quintic polynomial that agrees with both. The model is differentially flat in x, y, z and yaw, so that a path
determines the inputs as well.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.control.references.columns import (
    ACCELERATIONS,
    COLUMNS,
    POSE,
    POSITION,
    RATES,
    VELOCITY,
    X_RATE,
    YAW,
)
from rcopterx.control.references.trajectory import nearest_heading, whole_turns
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

PEAK_TO_MEAN_SPEED: Final = 1.875  # ratio of the peak to the mean speed from rest to rest
PEAK_ACCELERATION: Final = 10 / math.sqrt(3)  # of a quintic from rest to rest, times duration^2 / distance


def leg_time_s(way_m: float, speed_m_s: float, acceleration_m_s2: float) -> float:
    """Return the time of a quintic from rest to rest with this peak speed and acceleration at most."""
    return max(
        PEAK_TO_MEAN_SPEED * way_m / speed_m_s, math.sqrt(PEAK_ACCELERATION * way_m / acceleration_m_s2)
    )


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


KNOT_COLUMNS: Final = 1 + COLUMNS
MAX_KNOTS: Final = 600
RUN_IN_SPEED_M_S: Final = 0.5
RUN_IN_TURN_RAD_S: Final = 1.5
_CHECKED_EVERY_S: Final = 0.02


class PathError(ValueError):
    """A path that cannot be built or flown; the text says where and what is allowed."""


@dataclass(frozen=True)
class FlightPath:
    """A trajectory in time.

    `knots` has shape (n, 13), n from 2 to 600: time [s] from 0 on, x, y, z [m], yaw [rad], their first and
    second derivatives; inertial frame.
    """

    knots: Array

    @property
    def duration_s(self) -> float:
        """Time from the first knot to the last."""
        return float(self.knots[-1, 0])

    def sample(self, at_s: Array) -> Array:
        """Return the trajectory at some times, shape (k, 12); outside, the ends are held at rest."""
        knots = self.knots
        time = np.clip(at_s, 0.0, self.duration_s)
        right = np.clip(np.searchsorted(knots[:, 0], time, side="right"), 1, len(knots) - 1)
        before, after = knots[right - 1], knots[right]
        span = (after[:, 0] - before[:, 0])[:, None]
        s = (time - before[:, 0])[:, None] / span
        samples = quintic(before[:, 1:], after[:, 1:], span, s)
        samples[(at_s < 0.0) | (at_s > self.duration_s), X_RATE:] = 0.0
        return samples


def begun_from(path: FlightPath, present: Array, run_in_s: float) -> FlightPath:
    """Return the path after a smooth way of `run_in_s` from the present reference, a row of shape (12,)."""
    knots = path.knots.copy()
    knots[:, 1 + YAW] += math.tau * whole_turns(float(present[YAW] - knots[0, 1 + YAW]))
    knots[:, 0] += run_in_s
    return FlightPath(np.vstack((np.concatenate(([0.0], present)), knots)))


EASING_S: Final = 1.5  # time in which a suspended path comes to rest, and later that in which it goes on
_EASING_KNOTS: Final = 16
_APART_S: Final = 0.01  # knots that are closer differ by little more than rounding errors


def suspended(path: FlightPath, now_s: float, at_s: float) -> tuple[FlightPath, FlightPath] | None:
    """Split a path: from `now_s` on and, after `at_s`, to rest, and the rest of it, from rest on.

    Both stay on the curve of the path. None if it ends by itself before that.
    """
    at_s = max(at_s, now_s + _APART_S)
    if at_s + EASING_S + _APART_S >= path.duration_s:
        return None
    times_s = path.knots[:, 0]
    until = path.knots[(times_s > now_s + _APART_S) & (times_s < at_s - _APART_S)]
    after = path.knots[times_s > at_s + EASING_S + _APART_S]
    first = np.append(now_s, path.sample(np.array([now_s])))
    stopping = np.vstack((first[None], until, _eased(path, at_s, at_s, 1.0)))
    rest = np.vstack((_eased(path, at_s + 0.5 * EASING_S, 0.0, 0.0), after))
    stopping[:, 0] -= now_s
    rest[_EASING_KNOTS:, 0] -= at_s
    return FlightPath(stopping), FlightPath(rest)


def _eased(path: FlightPath, from_s: float, begin_s: float, pace: float) -> Array:
    """Return knots from `begin_s` on of a path whose time, `from_s` at first, begins or ceases to pass."""
    u = np.linspace(0.0, 1.0, _EASING_KNOTS)[:, None]
    paces, changes, _ = rest_to_rest(np.array([pace]), np.array([1.0 - pace]), u, EASING_S)
    passed_s = EASING_S * (pace * u + (1.0 - 2.0 * pace) * u**4 * (2.5 + u * (u - 3.0)))
    samples = path.sample(from_s + passed_s[:, 0])
    rates, accelerations = samples[:, RATES], samples[:, ACCELERATIONS] * paces**2
    return np.hstack(
        (begin_s + EASING_S * u, samples[:, POSE], rates * paces, accelerations + rates * changes)
    )


def run_in_time_s(path: FlightPath, present: Array) -> float:
    """Return the time of a smooth way from the present reference, shape (12,), to the start of a path."""
    first = path.knots[0, 1:]
    way_m = float(np.linalg.norm(first[POSITION] - present[POSITION]))
    turn_rad = abs(nearest_heading(float(first[YAW]), float(present[YAW])) - float(present[YAW]))
    speed = float(np.linalg.norm(present[VELOCITY])) / RUN_IN_SPEED_M_S
    return max(
        1.0,
        PEAK_TO_MEAN_SPEED * way_m / RUN_IN_SPEED_M_S,
        PEAK_TO_MEAN_SPEED * turn_rad / RUN_IN_TURN_RAD_S,
        2.0 * speed,
    )


def path_problem(path: FlightPath, model: Model, until_s: float) -> str | None:
    """Return where a path exceeds the model's limits before `until_s`; None if it does not."""
    times = np.arange(0.0, until_s + _CHECKED_EVERY_S, _CHECKED_EVERY_S)
    samples = path.sample(times)
    rate, acceleration = samples[:, RATES].copy(), samples[:, ACCELERATIONS].copy()
    for horizontal in (rate, acceleration):
        horizontal[:, :2] = in_frames(samples[:, YAW], horizontal[:, :2])
    allowed = np.minimum(-np.array(model.state_min)[3:7], np.array(model.state_max)[3:7])
    reach = model.b * model.stick_room
    for what, used, slower in (
        (("speed forward", "speed sideways", "climb", "yaw rate"), np.abs(rate) / allowed, 1.0),
        (("pitch", "roll", "thrust", "yaw input"), np.abs(acceleration - model.k * rate) / reach, 0.5),
    ):
        if used.max() > 1.0:
            at, axis = divmod(int(np.argmax(used)), used.shape[1])
            factor = float(used.max()) ** slower
            return (
                f"at {times[at]:.2f} s {what[axis]} would have to be {100 * used[at, axis]:.0f} % of what "
                f"the vehicle can; {factor:.2f} times as slow it could be flown"
            )
    return None


def in_frames(yaw_rad: Array, inertial: Array) -> Array:
    """Return horizontal vectors, shape (k, 2), in the frames of their headings, shape (k,)."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    x, y = inertial.T
    return np.column_stack((c * x + s * y, c * y - s * x))
