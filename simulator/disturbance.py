"""Seeded randomness of the laboratory: one independent stream per vehicle and purpose, and coloured noise."""

import math
from typing import Final

import numpy as np

PARAMETERS: Final = 0
TURBULENCE: Final = 1
NOISE: Final = 2
OUTLIERS: Final = 3
_BLOCK: Final = 256


def random_stream(seed: int, vehicle: str, purpose: int) -> np.random.Generator:
    """Random generator of one vehicle for one purpose.

    The stream depends on the vehicle's name, not on how many others fly, so that adding or removing a
    vehicle leaves the weather and the parameters of all others as they were.

    Parameters
    ----------
    seed
        Seed of the laboratory, not negative.
    vehicle
        Name of the vehicle.
    purpose
        `PARAMETERS`, `TURBULENCE`, `NOISE` or `OUTLIERS`.

    Returns
    -------
    numpy.random.Generator
        The generator.
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(purpose, *vehicle.encode())))


class NormalSource:
    """Standard normal numbers as plain floats, drawn in blocks because single draws are slow.

    Parameters
    ----------
    generator
        Where the numbers come from.
    """

    def __init__(self, generator: np.random.Generator) -> None:
        self._generator = generator
        self._numbers: list[float] = []

    def __call__(self) -> float:
        """Return the next number."""
        if not self._numbers:
            self._numbers = self._generator.standard_normal(_BLOCK)[::-1].tolist()
        return self._numbers.pop()

    def take(self, count: int) -> list[float]:
        """Return the next numbers, at once where a block holds them all."""
        if not 0 < count <= len(self._numbers):
            return [self() for _ in range(count)]
        taken = self._numbers[-count:]
        del self._numbers[-count:]
        taken.reverse()
        return taken


class ColouredNoise:
    """Stationary Ornstein-Uhlenbeck processes, discretised exactly on a fixed time grid.

    The value at a time depends on the seed and that time alone, not on the steps by which it was reached.

    Parameters
    ----------
    rms
        Root mean square of each channel.
    correlation_s
        Correlation time: the autocorrelation is exp(-t / correlation_s).
    grid_s
        Spacing of the time grid, on which the value is held.
    generator
        Source of randomness.
    """

    def __init__(
        self, rms: tuple[float, ...], correlation_s: float, grid_s: float, generator: np.random.Generator
    ) -> None:
        self._normal = NormalSource(generator)
        self._grid_s = grid_s
        self._keep = math.exp(-grid_s / correlation_s)
        renew = math.sqrt(-math.expm1(-2 * grid_s / correlation_s))
        self._renewal = tuple(renew * channel for channel in rms)
        self._index = 0
        self._value = tuple(channel * self._normal() for channel in rms)

    def at(self, time_s: float) -> tuple[float, ...]:
        """Value of all channels at a time that is not before the time last asked for."""
        index = int(time_s / self._grid_s)
        while self._index < index:
            keep, normals = self._keep, self._normal.take(len(self._renewal))
            parts = zip(self._value, self._renewal, normals, strict=True)
            self._value = tuple([keep * value + renew * normal for value, renew, normal in parts])
            self._index += 1
        return self._value
