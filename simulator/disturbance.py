"""Seeded randomness of the laboratory: one independent stream per vehicle and purpose, and coloured noise."""

import math
from typing import Final

import numpy as np

from rcopterx.compiling.compiled import COUNT, MATRIX, NUMBER, VECTOR, Array, compiled, part, together

PARAMETERS: Final = 0
TURBULENCE: Final = 1
NOISE: Final = 2
RADIO: Final = 3
GYRO: Final = 4
_BLOCK: Final = 256


def random_stream(seed: int, vehicle: str, purpose: int) -> np.random.Generator:
    """Random generator of one vehicle for a purpose, by seed and name: other vehicles do not change it."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(purpose, *vehicle.encode())))


HeldNoise = tuple[Array, int, float]
"""Noise that is constant between the times of a grid: values, shape (times, channels), the index of the first
of these times on the grid, and the spacing of the grid."""
HELD_NOISE: Final = together(MATRIX, COUNT, NUMBER)


@part
def value_at(noise: HeldNoise, time_s: float) -> Array:
    """Value of all channels."""
    values, first, grid_s = noise
    value: Array = values[int(time_s / grid_s) - first]
    return value


@compiled(MATRIX, VECTOR, NUMBER)
def correlate(steps: Array, start: Array, keep: float) -> None:
    """Turn random steps, shape (times, channels), into noise, in place, from the value `start`."""
    for time in range(len(steps)):
        for channel in range(len(start)):
            before = steps[time - 1, channel] if time else start[channel]
            steps[time, channel] += keep * before


class ColouredNoise:
    """Stationary Ornstein-Uhlenbeck processes, exact on a time grid; values depend on seed and time alone."""

    def __init__(
        self, rms: tuple[float, ...], correlation_s: float, grid_s: float, generator: np.random.Generator
    ) -> None:
        self._generator = generator
        self._keep = math.exp(-grid_s / correlation_s)
        self._renewal = math.sqrt(-math.expm1(-2 * grid_s / correlation_s)) * np.array(rms)
        self._known: HeldNoise = (np.array(rms) * generator.standard_normal((1, len(rms))), 0, grid_s)

    def between(self, begin_s: float, end_s: float) -> HeldNoise:
        """Noise that covers these times; `begin_s` must not be before that of earlier calls."""
        values, first, grid_s = self._known
        begin, end = int(begin_s / grid_s), int(end_s / grid_s)
        while first + len(values) <= end:
            steps = self._renewal * self._generator.standard_normal((_BLOCK, len(self._renewal)))
            correlate(steps, values[-1], self._keep)
            kept = values[begin - first :]
            first += len(values) - len(kept)
            values = np.concatenate((kept, steps))
            self._known = values, first, grid_s
        return self._known

    def at(self, time_s: float) -> tuple[float, ...]:
        """Value of all channels at a time that is not before that of earlier calls."""
        values, first, grid_s = self.between(time_s, time_s)
        return tuple(values[int(time_s / grid_s) - first].tolist())
