"""Detection of oscillations: a stick or the tilt that swings to and fro, again and again.

A half-wave begins when a signal passes its threshold on the other side than before. Half-waves that follow
each other as closely as those of an unstable loop do, 0.6 to 5 Hz, are counted: an oscillation goes on. On
its way to a new place a vehicle accelerates and brakes, and swings for a while; there more are needed.

Two things look like it and are not. Noise of the measurements passes thresholds at any time: so signals are
smoothed first, and a half-wave counts only if it is about as long as the last one to its side. A tilt with
little damping of its own rings after a step: so one counts only if it is about as large, too.
"""

import math
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array

SHORTEST_HALF_WAVE_S: Final = 0.1
LONGEST_HALF_WAVE_S: Final = 0.8
THRESHOLD: Final = 0.45
"""Share of a stick's range to either side of rest, and of the largest tilt, that counts when smoothed."""
SMOOTHING_S: Final = 0.02
ALIKE: Final = 2.0
"""Largest ratio of the lengths of two half-waves to the same side of one oscillation."""
FADING: Final = 0.85
"""Smallest ratio of their sizes; what fades faster ends by itself."""
HALF_WAVES: Final = 6
"""So many in a row are an oscillation of a vehicle that is near its reference."""
HALF_WAVES_AWAY: Final = 16
"""The same anywhere."""
FAINT_THRESHOLD: Final = 0.2
"""Threshold while the reference rests, where nothing but an oscillation goes to and fro for long."""
FAINT_HALF_WAVES: Final = 14
"""So many in a row past it are one."""
HALF_WAVES_AGAIN: Final = 2
FAINT_HALF_WAVES_AGAIN: Final = 6
"""So many more are needed after the loop has been changed: what is left of an oscillation fades first."""
NEAR_M: Final = 0.4
NEAR_RAD: Final = 0.8
"""Distance from the reference that is near."""


class Loop(IntEnum):
    """Loops of a vehicle that can oscillate by themselves."""

    HORIZONTAL = 0
    HEIGHT = 1
    YAW = 2


_LOOPS: Final = (
    Loop.HORIZONTAL,
    Loop.HORIZONTAL,
    Loop.HEIGHT,
    Loop.YAW,
    Loop.HORIZONTAL,
    Loop.HORIZONTAL,
)
"""Of the pitch, roll, thrust and yaw stick and of both components of the tilt."""
_SIGNALS: Final = ("pitch stick", "roll stick", "thrust stick", "yaw stick", "tilt to x", "tilt to y")


class Swing(NamedTuple):
    """An oscillation as it was seen last.

    Attributes
    ----------
    signal
        What swings, for people.
    frequency_hz
        By the last two half-waves.
    size
        Larger of both, smoothed, as a share of the stick's range to a side of rest or of the largest tilt.
    """

    signal: str
    frequency_hz: float
    size: float


class OscillationDetector:
    """Counts half-waves of the sticks and of the tilt of one vehicle.

    Parameters
    ----------
    model
        The vehicle, for what its sticks and its tilt can reach.
    """

    def __init__(self, model: Model) -> None:
        reach = np.minimum(model.u_max - model.hover_input, model.hover_input - model.u_min)
        tilt = float(model.b[:2].mean()) * float(reach[:2].mean()) / model.gravity_m_s2
        rests = [*model.hover_input.tolist(), 0.0, 0.0]
        ranges = [*reach.tolist(), tilt, tilt]
        self._ranges = ranges
        self._rested = False
        self.swings: dict[Loop, Swing] = {}
        """Of every loop that was found to oscillate."""
        self._channels, self._faint = (
            [
                _Channel(rest, threshold * largest, needed, again)
                for rest, largest in zip(rests, ranges, strict=True)
            ]
            for threshold, needed, again in (
                (THRESHOLD, (HALF_WAVES, HALF_WAVES_AWAY), HALF_WAVES_AGAIN),
                (FAINT_THRESHOLD, (FAINT_HALF_WAVES, FAINT_HALF_WAVES), FAINT_HALF_WAVES_AGAIN),
            )
        )

    def forget(self) -> None:
        """Begin anew."""
        for channel in (*self._channels, *self._faint):
            channel.forget()

    def changed(self, loops: frozenset[Loop]) -> None:
        """Loops are others now; an oscillation has to show that it goes on with them."""
        for loop, *both in zip(_LOOPS, self._channels, self._faint, strict=True):
            if loop in loops:
                for channel in both:
                    channel.doubt()

    def observe(
        self, stick: Array, tilt: Array | None, error: Array, period_s: float, resting: bool = False
    ) -> frozenset[Loop]:
        """Take in a control period.

        Parameters
        ----------
        stick
            Command, shape (4,).
        tilt
            Estimated horizontal components of the body's upward axis, shape (2,); None where not known.
        error
            Deviation from the reference: x, y, z [m], yaw [rad], shape (4,).
        period_s
            Time since the last one.
        resting
            Whether the reference rests, so that smaller oscillations count.

        Returns
        -------
        frozenset of Loop
            Loops whose oscillation begins another half-wave in this period.
        """
        axis = (0.0, 0.0) if tilt is None else tilt.tolist()
        x, y, z, yaw_rad = error.tolist()
        near = math.hypot(x, y, z) < NEAR_M and abs(yaw_rad) < NEAR_RAD
        values = (*stick.tolist(), *axis)
        if self._rested and not resting:
            for channel in self._faint:
                channel.forget()
        self._rested = resting
        # All of them, also after one that oscillates.
        found = {
            index: channel
            for index, (channel, value) in enumerate(zip(self._channels, values, strict=True))
            if channel.observe(value, near, period_s)
        }
        if resting:
            for index, (channel, value) in enumerate(zip(self._faint, values, strict=True)):
                if channel.observe(value, near, period_s):
                    found.setdefault(index, channel)
        for index, channel in found.items():
            frequency_hz, size = channel.wave
            self.swings[_LOOPS[index]] = Swing(_SIGNALS[index], frequency_hz, size / self._ranges[index])
        return frozenset(_LOOPS[index] for index in found)


class _Channel:
    """Half-waves of one signal, in plain floats because arrays of six take longer than the arithmetic."""

    def __init__(self, rest: float, threshold: float, needed: tuple[int, int], again: int) -> None:
        self._rest, self._threshold, self._again = rest, threshold, again
        self._needed_near, self._needed = needed
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._side = self._count = self._count_near = 0
        self._away = self._since_s = self._size = 0.0
        self._older: tuple[float, float] | None = None
        self._last: tuple[float, float] | None = None
        """How long the last two half-waves were, and how large; None for none."""

    def doubt(self) -> None:
        """Take some of the half-waves back."""
        self._count_near = min(self._count_near, self._needed_near - self._again)
        self._count = min(self._count, self._needed - self._again)

    def observe(self, value: float, near: bool, period_s: float) -> bool:
        """Take in a control period; True if an oscillation begins another half-wave."""
        away = self._away
        away += period_s / (period_s + SMOOTHING_S) * (value - self._rest - away)
        self._away, size = away, abs(away)
        self._since_s += period_s
        begins = False
        if size > self._threshold:
            side = 1 if away > 0.0 else -1
            begins = side != self._side
            if begins:
                self._begin(side)
        if size > self._size:
            self._size = size
        if self._since_s > LONGEST_HALF_WAVE_S:
            self._count = self._count_near = 0
        if not near:
            self._count_near = 0
        return begins and (self._count_near >= self._needed_near or self._count >= self._needed)

    @property
    def wave(self) -> tuple[float, float]:
        """Frequency [Hz] and size of the last two half-waves of an oscillation."""
        halves = [half for half in (self._older, self._last) if half is not None]
        return 0.5 * len(halves) / sum(lasted_s for lasted_s, _ in halves), max(size for _, size in halves)

    def _begin(self, side: int) -> None:
        """Count a half-wave that begins, and thereby the one before it that ends."""
        follows = self._side != 0 and SHORTEST_HALF_WAVE_S <= self._since_s <= LONGEST_HALF_WAVE_S
        if not follows:
            self._count = 1
        elif self._alike():
            self._count += 1
        else:
            # An oscillation that begins, or is disturbed, has some that are unlike.
            self._count = max(self._count - 1, 1)
        self._count_near = min(self._count_near + 1, self._count)
        self._older, self._last = self._last, (self._since_s, self._size) if follows else None
        self._side, self._since_s, self._size = side, 0.0, 0.0

    def _alike(self) -> bool:
        """Whether the half-wave that ends is like the last one to its side."""
        if self._older is None:
            return True
        lasted_s, size = self._older
        longer = max(lasted_s, self._since_s) / min(lasted_s, self._since_s)
        return longer <= ALIKE and self._size >= FADING * size
