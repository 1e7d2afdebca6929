"""Detection of oscillations: a stick or the tilt that swings to and fro, again and again.

A half-wave begins when a signal passes its threshold on the other side than before. Half-waves that follow
each other as closely as those of an unstable loop do, 0.6 to 5 Hz, are counted: an oscillation goes on. On
its way to a new place a vehicle accelerates and brakes, and swings for a while; there more are needed.

Two things look like it and are not. Noise of the measurements passes thresholds at any time: so signals are
smoothed first, and a half-wave counts only if it is about as long as the last one to its side. A tilt with
little damping of its own rings after a step: so one counts only if it is about as large, too.
"""

from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from rcopterx.native.watching import (
    CHANNEL,
    LAST_S,
    LAST_SIZE,
    LIMITS,
    NEEDED,
    NEEDED_NEAR,
    OLDER_S,
    OLDER_SIZE,
    SIGNALS,
    WAVES,
    WAVES_NEAR,
    observe_swings,
)
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, Array

THRESHOLD: Final = 0.45
"""Share of a stick's range to either side of rest, and of the largest tilt, that counts when smoothed."""
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

_NO_TILT: Final = np.empty(0)


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


_NONE: Final[frozenset[Loop]] = frozenset()


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
        self._ranges = [*reach.tolist(), tilt, tilt]
        self.swings: dict[Loop, Swing] = {}
        """Of every loop that was found to oscillate."""
        limits = [
            (rest, threshold * largest, near, anywhere)
            for threshold, near, anywhere in (
                (THRESHOLD, HALF_WAVES, HALF_WAVES_AWAY),
                (FAINT_THRESHOLD, FAINT_HALF_WAVES, FAINT_HALF_WAVES),
            )
            for rest, largest in zip(rests, self._ranges, strict=True)
        ]
        self._limits: Array = np.array(limits).reshape(2 * SIGNALS, LIMITS)
        self._channels: Array = np.zeros((2 * SIGNALS, CHANNEL))
        self._place: Array = np.full(INPUT_SIZE, np.nan)

    def forget(self) -> None:
        """Begin anew."""
        self._channels[:] = 0.0
        self._place[:] = np.nan

    def changed(self, loops: frozenset[Loop]) -> None:
        """Loops are others now; an oscillation has to show that it goes on with them."""
        for number, (channel, limits) in enumerate(zip(self._channels, self._limits, strict=True)):
            again = HALF_WAVES_AGAIN if number < SIGNALS else FAINT_HALF_WAVES_AGAIN
            if _LOOPS[number % SIGNALS] in loops:
                channel[WAVES_NEAR] = min(channel[WAVES_NEAR], limits[NEEDED_NEAR] - again)
                channel[WAVES] = min(channel[WAVES], limits[NEEDED] - again)

    def observe(
        self, stick: Array, tilt: Array | None, motion: Array, reference: Array, period_s: float
    ) -> frozenset[Loop]:
        """Take in a control period.

        Parameters
        ----------
        stick
            Command, shape (4,).
        tilt
            Estimated horizontal components of the body's upward axis, the first two entries; None where not
            known.
        motion
            Estimated motion state, shape (8,).
        reference
            Where the vehicle is to be: x, y, z [m], yaw [rad], shape (4,). While it rests, smaller
            oscillations count.
        period_s
            Time since the last one.

        Returns
        -------
        frozenset of Loop
            Loops whose oscillation begins another half-wave in this period.
        """
        found = observe_swings(
            self._channels,
            self._limits,
            self._place,
            stick,
            _NO_TILT if tilt is None else tilt,
            motion,
            reference,
            period_s,
        )
        return self._told(found) if found else _NONE

    def _told(self, found: int) -> frozenset[Loop]:
        """Loops of the channels that oscillate, which are remembered."""
        loops = set()
        for number in range(2 * SIGNALS):
            signal = number % SIGNALS
            # Large half-waves of a signal tell more than its small ones.
            if found >> number & 1 and (number == signal or not found >> signal & 1):
                frequency_hz, size = _wave(self._channels[number])
                self.swings[_LOOPS[signal]] = Swing(
                    _SIGNALS[signal], frequency_hz, size / self._ranges[signal]
                )
                loops.add(_LOOPS[signal])
        return frozenset(loops)


def _wave(channel: Array) -> tuple[float, float]:
    """Frequency [Hz] and size of the last two half-waves of an oscillation."""
    older_s, older, last_s, last = channel[[OLDER_S, OLDER_SIZE, LAST_S, LAST_SIZE]].tolist()
    halves = (older_s > 0.0) + (last_s > 0.0)
    return 0.5 * halves / (older_s + last_s), max(older, last)
