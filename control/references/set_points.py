"""References of vehicles without leaders: set points and smooth moves between them.

A controller samples its reference over the whole horizon at every step, so that it knows the changes ahead.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from msgspec import Struct

from rcopterx.control.references.paths import FlightPath
from rcopterx.control.references.quintic import PEAK_TO_MEAN_SPEED, quintic
from rcopterx.control.references.trajectory import (
    COLUMNS,
    POSITION,
    YAW,
    YAW_ACCELERATION,
    YAW_RATE,
    Trajectory,
    hold,
)
from rcopterx.vehicles.state import Array

_TURN_DURATIONS_S = np.geomspace(0.2, 120.0, 90)
_TURN_MOMENTS = np.linspace(0.0, 1.0, 21)


class ReferenceSource(Protocol):
    """A reference as a function of time."""

    def sample(self, time_s: float, period_s: float, stages: int) -> Trajectory:
        """Return the reference at `stages` instants from `time_s` on, `period_s` apart."""
        ...

    def finished(self, time_s: float) -> bool:
        """Return whether the reference is constant from `time_s` on."""
        ...


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


class TimedPath(Struct, frozen=True):
    """A path from `start_s` on; afterwards its end is held."""

    path: FlightPath
    start_s: float

    def sample(self, time_s: float, period_s: float, stages: int) -> Trajectory:
        """See `ReferenceSource.sample`."""
        at_s: Array = time_s - self.start_s + period_s * np.arange(float(stages))
        return Trajectory(self.path.sample(at_s), period_s)

    def finished(self, time_s: float) -> bool:
        """See `ReferenceSource.finished`."""
        return time_s >= self.start_s + self.path.duration_s


class PathReference(TimedPath, frozen=True):
    """A trajectory that was requested."""


class Transition(TimedPath, frozen=True):
    """A smooth way to a set point."""


@dataclass(frozen=True, slots=True)
class TurnLimits:
    """Limits of a heading that carries other vehicles round.

    `acceleration_rad_s2` limits sqrt(psi''^2 + psi'^4): times the arm, the acceleration of a carried vehicle.
    """

    rate_rad_s: float
    acceleration_rad_s2: float

    def used(self, samples: Array) -> Array:
        """Return the used share of the limits in rows of a trajectory."""
        rate, acceleration = samples[..., YAW_RATE], samples[..., YAW_ACCELERATION]
        spin = np.hypot(acceleration, rate**2)
        return np.maximum(np.abs(rate) / self.rate_rad_s, spin / self.acceleration_rad_s2)


def smooth_move(
    start_m: Array, end_m: Array, yaw_rad: float, start_s: float, peak_speed_m_s: float
) -> Transition:
    """Return a quintic polynomial from rest to rest along a straight line, heading held."""
    begin, end = np.zeros((2, COLUMNS))
    begin[POSITION], end[POSITION] = start_m, end_m
    begin[YAW] = end[YAW] = yaw_rad
    duration_s = max(PEAK_TO_MEAN_SPEED * float(np.linalg.norm(end_m - start_m)) / peak_speed_m_s, 1e-3)
    return _through(start_s, (0.0, begin), (duration_s, end))


def smooth_turn(
    limits: TurnLimits, position_m: Array, yaw_rad: float, present: Array, time_s: float
) -> Transition:
    """Hold one place and make the shortest turn within limits, by one or two quintic polynomials.

    Parameters
    ----------
    position_m, yaw_rad
        Place to hold from now on, shape (3,), and final heading [unwrapped].
    present
        Row of the present reference, shape (12,), from which the heading continues.
    """
    begin, end = np.zeros((2, COLUMNS))
    begin[POSITION] = end[POSITION] = position_m
    begin[YAW::4] = present[YAW::4]
    end[YAW] = yaw_rad
    duration_s, used = _gentle_turn(limits, begin, end[None])
    if used <= 1.0:
        return _through(time_s, (0.0, begin), (duration_s, end))
    # The heading moves too fast, or the other way, for one turn: it comes to rest first.
    stops = np.tile(begin, (len(_TURN_DURATIONS_S), 1))
    stops[:, YAW_RATE] = stops[:, YAW_ACCELERATION] = 0.0
    # Where a quintic that ends at rest loses its highest power, which is the gentlest place to stop.
    stops[:, YAW] += begin[YAW_RATE] * _TURN_DURATIONS_S / 2
    stops[:, YAW] += begin[YAW_ACCELERATION] * _TURN_DURATIONS_S**2 / 12
    stop_s, _ = _gentle_turn(limits, begin, stops)
    stop = stops[np.searchsorted(_TURN_DURATIONS_S, stop_s)]
    duration_s, _ = _gentle_turn(limits, stop, end[None])
    return _through(time_s, (0.0, begin), (stop_s, stop), (stop_s + duration_s, end))


def _gentle_turn(limits: TurnLimits, begin: Array, ends: Array) -> tuple[float, float]:
    """Shortest duration [s] of a quintic within limits, else the gentlest; and its share of the limits.

    Rows `ends` belong to `_TURN_DURATIONS_S`, or one row to all of them.
    """
    durations, moments = np.meshgrid(_TURN_DURATIONS_S, _TURN_MOMENTS, indexing="ij")
    after = np.repeat(np.broadcast_to(ends, (len(durations), COLUMNS)), len(_TURN_MOMENTS), axis=0)
    rows = quintic(begin[None], after, durations.reshape(-1, 1), moments.reshape(-1, 1))
    used = limits.used(rows).reshape(durations.shape).max(axis=1)
    within = used <= 1.0
    best = int(np.argmax(within)) if within.any() else int(np.argmin(used))
    return float(_TURN_DURATIONS_S[best]), float(used[best])


def _through(start_s: float, *knots: tuple[float, Array]) -> Transition:
    return Transition(FlightPath(np.array([[time_s, *row] for time_s, row in knots])), start_s)
