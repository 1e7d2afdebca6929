"""Seeded randomness of the laboratory: one independent stream per vehicle and purpose, and coloured noise."""

import math
from typing import Final

import numpy as np

from rcopterx.native.turbulence import turbulence_renewed

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

    Attributes
    ----------
    value, renewal, keep, normals, place
        See `rcopterx.native.turbulence.turbulence_renewed`; kernels that fly vehicles move them on.
    index
        Of the value on the time grid.
    """

    def __init__(
        self, rms: tuple[float, ...], correlation_s: float, grid_s: float, generator: np.random.Generator
    ) -> None:
        self.grid_s = grid_s
        self.keep = math.exp(-grid_s / correlation_s)
        renew = math.sqrt(-math.expm1(-2 * grid_s / correlation_s))
        self.renewal = np.array([renew * channel for channel in rms])
        self.index = self.place = 0
        self.normals = np.empty(0)
        self._generator = generator
        self.provide()
        self.value = np.array(rms) * self.normals[: len(rms)]
        self.place = len(rms)

    def provide(self) -> None:
        """Draw numbers if there are not enough for another step of the time grid."""
        if self.place + len(self.renewal) > len(self.normals):
            drawn = self._generator.standard_normal(_BLOCK)
            self.normals, self.place = np.concatenate((self.normals[self.place :], drawn)), 0

    def at(self, time_s: float) -> tuple[float, ...]:
        """Value of all channels at a time that is not before the time last asked for."""
        index = int(time_s / self.grid_s)
        steps = index - self.index
        while steps > 0:
            self.provide()
            steps, self.place = turbulence_renewed(
                self.value, self.renewal, self.keep, self.normals, self.place, steps
            )
        self.index = max(self.index, index)
        return tuple(self.value.tolist())
