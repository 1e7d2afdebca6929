"""Detection of oscillations of a stick or of the tilt.

A half-wave begins when a signal passes its threshold on the other side than before. Half-waves at the
frequencies of an unstable loop, 0.6 to 5 Hz, are counted: many of them in a row are an oscillation, still
more of them far from the reference, where a vehicle accelerates and brakes.

Noise passes thresholds at any time, so signals are smoothed, and a half-wave counts only if it is about as
long as the last one to its side. A tilt with little damping rings after a step, so a half-wave counts only if
it is about as large, too.
"""

import math
from collections.abc import Iterable
from enum import IntEnum
from typing import Final, NamedTuple

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2, YAW, Array

THRESHOLD: Final = 0.45  # share of a stick's range beside rest, or of the largest tilt, that counts
HALF_WAVES: Final = 6  # so many in a row are an oscillation of a vehicle that is near its reference
HALF_WAVES_AWAY: Final = 16  # the same anywhere
FAINT_THRESHOLD: Final = 0.2  # the same while the reference rests, where only an oscillation goes to and fro
FAINT_HALF_WAVES: Final = 14  # so many in a row past it are one
HALF_WAVES_AGAIN: Final = 2
FAINT_HALF_WAVES_AGAIN: Final = 6  # so many more after a change of the loop, as the oscillation fades

SHORTEST_HALF_WAVE_S: Final = 0.1
LONGEST_HALF_WAVE_S: Final = 0.8
SMOOTHING_S: Final = 0.02
ALIKE: Final = 2.0  # largest ratio of the lengths of two half-waves to the same side of one oscillation
FADING: Final = 0.85  # smallest ratio of their sizes; an oscillation that fades faster ends by itself
NEAR_M: Final = 0.4
NEAR_RAD: Final = 0.8  # distance from the reference that is near
RESTING_M_S: Final = 0.05  # a reference slower than this rests


class Loop(IntEnum):
    """Loops of a vehicle that can oscillate by themselves."""

    HORIZONTAL = 0
    HEIGHT = 1
    YAW = 2


_SIGNALS: Final = (
    ("pitch stick", Loop.HORIZONTAL),
    ("roll stick", Loop.HORIZONTAL),
    ("thrust stick", Loop.HEIGHT),
    ("yaw stick", Loop.YAW),
    ("tilt to x", Loop.HORIZONTAL),
    ("tilt to y", Loop.HORIZONTAL),
)


class Swing(NamedTuple):
    """Last two half-waves of an oscillation."""

    signal: str  # name for people
    frequency_hz: float
    size: float  # share of the stick's range to a side of rest, or of the largest tilt


class _HalfWave(NamedTuple):
    length_s: float
    size: float


class _Channel:
    """Counter of the half-waves of one signal beyond one threshold."""

    def __init__(self, name: str, loop: Loop, rest: float, reach: float, *, faint: bool) -> None:
        self.name, self.loop = name, loop
        self._rest, self._reach = rest, reach
        self._threshold = (FAINT_THRESHOLD if faint else THRESHOLD) * reach
        self._needed_near = FAINT_HALF_WAVES if faint else HALF_WAVES
        self._needed = FAINT_HALF_WAVES if faint else HALF_WAVES_AWAY
        self._needed_again = FAINT_HALF_WAVES_AGAIN if faint else HALF_WAVES_AGAIN
        self.reset()

    def reset(self) -> None:
        self._away = 0.0  # the smoothed signal less its rest
        self._side = 0.0  # side of the present half-wave; 0 before the first one
        self._length_s = self._size = 0.0  # of the present half-wave so far
        self._count = self._count_near = 0  # half-waves in a row, anywhere and near the reference
        self._last: _HalfWave | None = None
        self._last_but_one: _HalfWave | None = None

    def require_again(self) -> None:
        """Require some more half-waves before an oscillation is found again."""
        self._count_near = min(self._count_near, self._needed_near - self._needed_again)
        self._count = min(self._count, self._needed - self._needed_again)

    def observe(self, value: float, near: bool, period_s: float) -> bool:
        """Process one control period; return whether an oscillation begins another half-wave."""
        self._away += period_s / (period_s + SMOOTHING_S) * (value - self._rest - self._away)
        self._length_s += period_s
        size, side = abs(self._away), math.copysign(1.0, self._away)
        begins = size > self._threshold and side != self._side
        if begins:
            self._begin_half_wave(side)
        self._size = max(self._size, size)
        if self._length_s > LONGEST_HALF_WAVE_S:
            self._count = self._count_near = 0
        if not near:
            self._count_near = 0
        return begins and (self._count_near >= self._needed_near or self._count >= self._needed)

    def _begin_half_wave(self, side: float) -> None:
        ended = _HalfWave(self._length_s, self._size)
        follows = self._side != 0.0 and SHORTEST_HALF_WAVE_S <= ended.length_s <= LONGEST_HALF_WAVE_S
        if not follows:
            self._count = 1
        elif self._last_but_one is None or _alike(self._last_but_one, ended):
            self._count += 1
        else:
            # An oscillation that begins, or is disturbed, has some that are unlike.
            self._count = max(self._count - 1, 1)
        self._count_near = min(self._count_near + 1, self._count)
        self._last_but_one, self._last = self._last, ended if follows else None
        self._side, self._length_s, self._size = side, 0.0, 0.0

    def swing(self) -> Swing:
        """Return the oscillation by its last two half-waves."""
        waves = [wave for wave in (self._last_but_one, self._last) if wave is not None]
        frequency_hz = 0.5 * len(waves) / sum(wave.length_s for wave in waves)
        return Swing(self.name, frequency_hz, max(wave.size for wave in waves) / self._reach)


def _alike(earlier: _HalfWave, later: _HalfWave) -> bool:
    lengths = earlier.length_s, later.length_s
    return max(lengths) / min(lengths) <= ALIKE and later.size >= FADING * earlier.size


class OscillationDetector:
    """Counts half-waves of the sticks and of the tilt of one vehicle, whose model is `model`."""

    def __init__(self, model: Model) -> None:
        self.model = model
        room = model.stick_room
        tilt = float(model.b[:2].mean()) * float(room[:2].mean()) / GRAVITY_M_S2
        rests = (*model.hover_input.tolist(), 0.0, 0.0)
        reaches = (*room.tolist(), tilt, tilt)

        def channels(faint: bool) -> list[_Channel]:
            return [
                _Channel(name, loop, rest, reach, faint=faint)
                for (name, loop), rest, reach in zip(_SIGNALS, rests, reaches, strict=True)
            ]

        self._large, self._faint = channels(faint=False), channels(faint=True)
        self._last_place_m: list[float] | None = None  # position of the last reference
        self._rested = False  # whether the reference rested in the last period
        self.swings: dict[Loop, Swing] = {}  # last oscillation of every loop that has been found to oscillate

    def forget(self) -> None:
        """Discard all half-waves."""
        for channel in (*self._large, *self._faint):
            channel.reset()
        self._last_place_m, self._rested = None, False

    def changed(self, loops: Iterable[Loop]) -> None:
        """Require some more half-waves of loops that have been changed."""
        for channel in (*self._large, *self._faint):
            if channel.loop in loops:
                channel.require_again()

    def observe(
        self, stick: Array, tilt: Array | None, motion: Array, reference: Array, period_s: float
    ) -> frozenset[Loop]:
        """Process one control period; return the loops whose oscillation begins another half-wave.

        `stick` (4,), `motion` (8,) and `reference` (4,) as elsewhere; `tilt` is estimated, None if unknown.
        While the reference rests, smaller oscillations count.
        """
        place_m = reference[:3].tolist()
        resting = self._rests(place_m, period_s)
        if self._rested and not resting:
            for channel in self._faint:
                channel.reset()
        self._last_place_m, self._rested = place_m, resting
        near = math.dist(motion[:3].tolist(), place_m) < NEAR_M
        near = near and abs(float(motion[YAW] - reference[YAW])) < NEAR_RAD
        values = [*stick.tolist(), *((0.0, 0.0) if tilt is None else tilt[:2].tolist())]
        found: dict[str, _Channel] = {}
        for channels in (self._large, self._faint) if resting else (self._large,):
            for channel, value in zip(channels, values, strict=True):
                if channel.observe(value, near, period_s):
                    # The large half-waves of a signal show more than its small ones.
                    found.setdefault(channel.name, channel)
        self.swings.update({channel.loop: channel.swing() for channel in found.values()})
        return frozenset(channel.loop for channel in found.values())

    def _rests(self, place_m: list[float], period_s: float) -> bool:
        last_m = self._last_place_m
        return last_m is not None and all(
            abs(now - before) < RESTING_M_S * period_s for now, before in zip(place_m, last_m, strict=True)
        )
