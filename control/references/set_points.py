"""References of vehicles without leaders, over the whole horizon: set points, smooth moves, landing."""

import math
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from msgspec import Struct

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
from rcopterx.control.references.paths import (
    PEAK_TO_MEAN_SPEED,
    FlightPath,
    leg_time_s,
    quintic,
    quintic_jerk,
    suspended,
)
from rcopterx.control.references.trajectory import Trajectory, hold
from rcopterx.vehicles.state import Array, Z
from rcopterx.vehicles.tuples import Three

_DURATIONS_S = np.geomspace(0.2, 120.0, 90)
_MOMENTS = np.linspace(0.0, 1.0, 21)
_WAIT_S = 0.1


class ReferenceSource(Protocol):
    """A reference as a function of time."""

    def sample(self, time_s: float, period_s: float, stages: int) -> Trajectory:
        """Return the reference at `stages` instants from `time_s` on, `period_s` apart."""

    def finished(self, time_s: float) -> bool:
        """Return whether the reference is constant from `time_s` on."""

    def end(self) -> tuple[Array, float]:
        """Return position [m], shape (3,), and yaw [rad] at which the reference ends."""


class SetPointReference(Struct, frozen=True):
    """One place and one heading: position [m], shape (3,), and yaw [rad, unwrapped]."""

    position_m: Array
    yaw_rad: float

    def sample(self, time_s: float, period_s: float, stages: int) -> Trajectory:  # noqa: ARG002 - constant
        """See `ReferenceSource.sample`."""
        return hold(self.position_m, self.yaw_rad, period_s, stages)

    def finished(self, time_s: float) -> bool:  # noqa: ARG002 - constant in time
        """See `ReferenceSource.finished`."""
        return True

    def end(self) -> tuple[Array, float]:
        """See `ReferenceSource.end`."""
        return self.position_m, self.yaw_rad


class TimedPath(Struct, frozen=True):
    """A path from `start_s` on; afterwards its end is held."""

    path: FlightPath
    start_s: float

    def sample(self, time_s: float, period_s: float, stages: int) -> Trajectory:
        """See `ReferenceSource.sample`."""
        if time_s > self.start_s + self.path.duration_s:
            return hold(*self.end(), period_s, stages)
        at_s: Array = time_s - self.start_s + period_s * np.arange(float(stages))
        return Trajectory(self.path.sample(at_s), period_s)

    def finished(self, time_s: float) -> bool:
        """See `ReferenceSource.finished`."""
        return time_s >= self.start_s + self.path.duration_s

    def end(self) -> tuple[Array, float]:
        """See `ReferenceSource.end`."""
        end = self.path.knots[-1, 1:]
        return end[POSITION], float(end[YAW])

    def suspended(self, time_s: float, at_s: float) -> "SuspendedPath | None":
        """Return the path, suspended `at_s`; None if it ends before. `time_s`: present time."""
        parts = suspended(self.path, time_s - self.start_s, at_s - self.start_s)
        return None if parts is None else SuspendedPath(parts[0], time_s, parts[1], type(self))


class PathReference(TimedPath, frozen=True):
    """A trajectory that was requested."""


class ProfileTransition(TimedPath, frozen=True):
    """A smooth way to a set point."""


class SuspendedPath(TimedPath, frozen=True):
    """The way to rest on a path that was suspended, and what is left of it."""

    rest: FlightPath
    kind: type[TimedPath]  # of the path that was suspended


@dataclass(frozen=True, slots=True)
class ProfileLimits:
    """Limits of the way of a leader: horizontal, vertical, of the heading (there sqrt(psi''^2 + psi'^4))."""

    rate: Three  # [m/s], [m/s], [rad/s]
    acceleration: Three
    jerk: Three

    def used(self, samples: Array, jerk: Array) -> Array:
        """Return the largest used share of a limit, shape (k,), in rows of a trajectory and of its jerk."""
        rate, acceleration = samples[:, RATES], samples[:, ACCELERATIONS].copy()
        acceleration[:, YAW] = np.hypot(acceleration[:, YAW], rate[:, YAW] ** 2)
        shares = [
            np.column_stack((np.hypot(each[:, 0], each[:, 1]), np.abs(each[:, 2:]))) / limit
            for each, limit in ((rate, self.rate), (acceleration, self.acceleration), (jerk, self.jerk))
        ]
        return np.asarray(np.max(shares, axis=(0, 2)))


def smooth_move(
    start_m: Array, end_m: Array, yaw_rad: float, start_s: float, peak_speed_m_s: float
) -> ProfileTransition:
    """Return a quintic polynomial from rest to rest along a straight line, heading held."""
    begin, end = np.zeros((2, COLUMNS))
    begin[POSITION], end[POSITION] = start_m, end_m
    begin[YAW] = end[YAW] = yaw_rad
    duration_s = max(PEAK_TO_MEAN_SPEED * float(np.linalg.norm(end_m - start_m)) / peak_speed_m_s, 1e-3)
    return transition_through(start_s, (0.0, begin), (duration_s, end))


def smooth_way(
    limits: ProfileLimits, position_m: Array, yaw_rad: float, present: ReferenceSource, time_s: float
) -> ProfileTransition:
    """Go from a reference to rest at a set point within limits.

    The way is a quintic polynomial. It begins once the present transition, which is continued till then, can
    be left within the limits. Another reference that is too fast is stopped first.

    `position_m` and `yaw_rad`: place, shape (3,), and heading [unwrapped] at the end. `present`: reference
    until now, from which the way begins at `time_s`.
    """
    end = np.zeros(COLUMNS)
    end[POSITION], end[YAW] = position_m, yaw_rad
    waits = 1
    if isinstance(present, ProfileTransition):
        waits += math.ceil(max(0.0, present.start_s + present.path.duration_s - time_s) / _WAIT_S)
    rows = present.sample(time_s, _WAIT_S, waits).samples
    for wait, row in enumerate(rows):
        duration_s, used = _gentle_way(limits, row, end[None])
        if used <= 1.0:
            knots = [(number * _WAIT_S, rows[number]) for number in range(wait + 1)]
            return transition_through(time_s, *knots, (wait * _WAIT_S + duration_s, end))
    begin = rows[0]
    stops = np.tile(begin, (len(_DURATIONS_S), 1))
    stops[:, X_RATE:] = 0.0
    # Where a quintic that ends at rest loses its highest power, which is the gentlest place to stop.
    times = _DURATIONS_S[:, None]
    stops[:, POSE] += begin[RATES] * times / 2 + begin[ACCELERATIONS] * times**2 / 12
    stop_s, _ = _gentle_way(limits, begin, stops)
    stop = stops[np.searchsorted(_DURATIONS_S, stop_s)]
    duration_s, _ = _gentle_way(limits, stop, end[None])
    return transition_through(time_s, (0.0, begin), (stop_s, stop), (stop_s + duration_s, end))


def _gentle_way(limits: ProfileLimits, begin: Array, ends: Array) -> tuple[float, float]:
    """Shortest quintic within limits, else the gentlest: its duration [s] and its share of the limits."""
    durations, moments = np.meshgrid(_DURATIONS_S, _MOMENTS, indexing="ij")
    after = np.repeat(np.broadcast_to(ends, (len(durations), COLUMNS)), len(_MOMENTS), axis=0)
    way = (begin[None], after, durations.reshape(-1, 1), moments.reshape(-1, 1))
    used = limits.used(quintic(*way), quintic_jerk(*way)).reshape(durations.shape).max(axis=1)
    within = used <= 1.0
    best = int(np.argmax(within)) if within.any() else int(np.argmin(used))
    return float(_DURATIONS_S[best]), float(used[best])


def transition_through(start_s: float, *knots: tuple[float, Array]) -> ProfileTransition:
    """Return a transition through times after `start_s` [s] and rows of a trajectory, shape (12,)."""
    return ProfileTransition(FlightPath(np.array([[time_s, *row] for time_s, row in knots])), start_s)


DESCENT_SPEED_M_S: Final = 0.7
DESCENT_ACCELERATION_M_S2: Final = 0.8
FLARE_M: Final = 0.2  # height above the floor from which the vehicle descends slowly
TOUCHDOWN_SPEED_M_S: Final = 0.25
SHORTEST_FAST_M: Final = 0.1  # over less, a vehicle at rest would have to jerk to reach the slow speed
DEPTH_M: Final = 0.3  # the reference ends so far below the floor, where the vehicle is seen to be stopped


def descent(start_m: Array, floor_m: float, yaw_rad: float, start_s: float) -> ProfileTransition:
    """Descend straight from rest at `start_m`, shape (3,), through the floor, whose height is `floor_m`.

    The vehicle is fast down to just above the floor, then slow until it is seen to stand.
    """
    end_m = np.array([start_m[0], start_m[1], floor_m - DEPTH_M])
    fast_m = float(start_m[2]) - floor_m - FLARE_M
    if fast_m < SHORTEST_FAST_M:
        return smooth_move(start_m, end_m, yaw_rad, start_s, TOUCHDOWN_SPEED_M_S)
    fast_s = leg_time_s(fast_m, DESCENT_SPEED_M_S, DESCENT_ACCELERATION_M_S2)
    slow_s = 2.0 * (FLARE_M + DEPTH_M) / TOUCHDOWN_SPEED_M_S  # to rest, at an even deceleration
    begin, flare, end = np.zeros((3, COLUMNS))
    for knot, place_m in ((begin, start_m), (flare, end_m), (end, end_m)):
        knot[POSITION], knot[YAW] = place_m, yaw_rad
    flare[POSITION][Z] = floor_m + FLARE_M
    flare[VELOCITY][Z] = -TOUCHDOWN_SPEED_M_S
    return transition_through(start_s, (0.0, begin), (fast_s, flare), (fast_s + slow_s, end))
