"""Multisines on the sticks of a flying vehicle, added to the commands of its controller.

Every axis has its own frequencies, so that all axes are excited at once and their responses, including the
coupling of pitch and roll, can be separated; so have neighbours that are excited at the same time. The
controller continues to hold the vehicle in place; a prediction-error fit is consistent in closed loop.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import INPUT_SIZE, U_YAW, Array, four

BASE_HZ: Final = 0.05  # all frequencies are multiples of it, so that the signal repeats every 20 s
COMBS: Final = 3  # sets of frequencies, which do not meet within 60 s
FADE_S: Final = 2.0
_LATERAL_BAND_HZ: Final = (0.4, 4.5)
_THRUST_BAND_HZ: Final = (0.3, 3.0)
_YAW_BAND_HZ: Final = (0.4, 2.5)
_TONES: Final = (10, 10, 6, 6)
FULL: Final = np.array((0.3, 0.3, 0.35, 0.4))
"""Root mean square of accelerations by pitch, roll and thrust [m/s^2], and of the yaw rate [rad/s]."""


@dataclass(frozen=True)
class Excitation:
    """A multisine on every stick, of root mean square `amplitude`; it fades in and out within `FADE_S`.

    Excitations of different `comb` have different frequencies. Raises ValueError for an amplitude outside 0
    to 1, an unknown comb, or a duration too short to separate the tones of two axes.
    """

    amplitude: tuple[float, ...]
    duration_s: float
    comb: int = 0

    def __post_init__(self) -> None:
        if len(self.amplitude) != INPUT_SIZE or not all(0.0 <= a <= 1.0 for a in self.amplitude):
            raise ValueError(f"amplitude: four numbers from 0 to 1, got {self.amplitude}")
        if not 1.0 / BASE_HZ <= self.duration_s <= 600.0:
            raise ValueError(f"duration_s: must be from {1 / BASE_HZ:g} to 600 s, got {self.duration_s}")
        if not 0 <= self.comb < COMBS:
            raise ValueError(f"comb: must be from 0 to {COMBS - 1}, got {self.comb}")

    def at(self, time_s: float) -> Array:
        """Return the addition to the sticks, shape (4,), some time after the start; zeros outside."""
        if not 0.0 <= time_s < self.duration_s:
            return np.zeros(INPUT_SIZE)
        fade = min(1.0, time_s / FADE_S, (self.duration_s - time_s) / FADE_S)
        shift_hz = self.comb * BASE_HZ / COMBS
        return np.array(
            [
                fade * rms * math.sqrt(2.0 / len(tones)) * _sum_of_tones(tones, shift_hz, time_s)
                for rms, tones in zip(self.amplitude, TONES_HZ, strict=True)
            ]
        )


def _sum_of_tones(tones_hz: Sequence[float], shift_hz: float, time_s: float) -> float:
    """Sum of unit sines, each shifted by a frequency, with Schroeder's phases, which keep its peaks low."""
    count = len(tones_hz)
    return sum(
        math.sin(math.tau * (hz + shift_hz) * time_s + math.pi * index * (index + 1) / count)
        for index, hz in enumerate(tones_hz)
    )


def _all_tones() -> tuple[tuple[float, ...], ...]:
    """Frequencies of the four axes, each used once, spread evenly over the logarithm of its band."""
    taken: set[int] = set()
    tones = []
    bands = (_LATERAL_BAND_HZ, _LATERAL_BAND_HZ, _THRUST_BAND_HZ, _YAW_BAND_HZ)
    for axis, ((low, high), count) in enumerate(zip(bands, _TONES, strict=True)):
        own = []
        shift = (0.0, 0.5, 0.25, 0.75)[axis]
        for index in range(count):
            hz = low * (high / low) ** ((index + shift) / count)
            harmonic = round(hz / BASE_HZ)
            while harmonic in taken:
                harmonic += 1
            taken.add(harmonic)
            own.append(harmonic * BASE_HZ)
        tones.append(tuple(own))
    return tuple(tones)


TONES_HZ: Final = _all_tones()  # frequencies on pitch, roll, thrust and yaw of the first comb


def excitation_for(model: Model, duration_s: float, strength: float = 1.0, comb: int = 0) -> Excitation:
    """Return the excitation that moves this model by centimetres, times `strength`."""
    gain = model.b / (1.0, 1.0, 1.0, max(-model.damping[U_YAW], 1.0))
    amplitude = np.minimum(strength * (FULL / gain), 0.25 * model.stick_room)
    return Excitation(four(amplitude), duration_s, comb)


LONGEST_BLIND_S: Final = 0.1  # the excitation ends without poses for longer than this
UNDER_WAY: Final = "under way"
DONE: Final = "done"


class Exciter:
    """Adds an excitation to the commands of a controller."""

    def __init__(self) -> None:
        self.outcome = ""  # why the last excitation ended; `under way` or `done`; empty before the first
        self.under_way = False
        self._excitation: Excitation | None = None
        self._start_s = 0.0
        self._place_m: Array = np.zeros(3)
        self._reach_m = 0.0

    def begin(self, excitation: Excitation, place_m: Array, reach_m: float, time_s: float) -> None:
        """Start an excitation in a box of half-width `reach_m` around a place, inertial, shape (3,)."""
        self._excitation, self._start_s, self.under_way = excitation, time_s, True
        self._place_m, self._reach_m = place_m.copy(), reach_m
        self.outcome = UNDER_WAY

    def end(self, outcome: str) -> None:
        """End the present excitation, if there is one, for a reason."""
        if self._excitation is not None:
            self._excitation, self.outcome, self.under_way = None, outcome, False

    def left_s(self, time_s: float) -> float:
        """Return the remaining time of the excitation; 0 without one."""
        if self._excitation is None:
            return 0.0
        return max(0.0, self._start_s + self._excitation.duration_s - time_s)

    def watch(self, time_s: float, position_m: Array, blind_s: float, flying: bool) -> None:
        """End an excitation that is over, or whose limits are exceeded: place, blind time, free flight."""
        if self._excitation is None:
            return
        away_m = np.abs(position_m - self._place_m)
        if not flying:
            self.end("the vehicle does not fly freely any more")
        elif blind_s > LONGEST_BLIND_S:
            self.end(f"no pose for {blind_s:.2f} s")
        elif away_m.max() > self._reach_m:
            self.end(f"{away_m.max():.2f} m from its place, at most {self._reach_m:g} m are allowed")
        elif self.left_s(time_s) == 0.0:
            self.end(DONE)

    def added(self, inputs: Array, time_s: float, period_s: float) -> Array:
        """Return inputs of the coming periods, shape (k, 4), with the excitation added."""
        excitation = self._excitation
        if excitation is None:
            return inputs
        since_s = time_s - self._start_s
        rows = [excitation.at(since_s + row * period_s) for row in range(len(inputs))]
        return np.asarray(inputs + np.array(rows))
