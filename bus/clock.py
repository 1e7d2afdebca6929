"""The clock of a fleet: the monotonic clock of its host, in a simulated laboratory also a multiple of it.

All processes of a host and programs that join its fleet compute the same time from the same monotonic clock.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import floor
from time import monotonic
from typing import Final

from rcopterx.bus.rounding import TIME_BITS, monotonic_s

NANO: Final = 1_000_000_000
"""Nanoseconds of a second."""
_TICKS: Final = 2.0**TIME_BITS


@dataclass(frozen=True)
class Clock:
    """Time of a fleet that passes at `speed` times real time; its durations are those of the fleet [s]."""

    speed: float = 1.0

    @property
    def now(self) -> Callable[[], float]:
        """Function that returns the time of the fleet [s], in whole ticks of 2^-20 s."""
        if self.speed == 1.0:
            return monotonic_s
        ticks = self.speed * _TICKS
        return lambda: floor(ticks * monotonic()) / _TICKS

    def real_s(self, seconds: float) -> float:
        """Return the real time of a duration [s]."""
        return seconds / self.speed

    def scaled(self, real: Callable[[], float]) -> Callable[[], float]:
        """Return another clock, for instance of processor time, in seconds of the fleet."""
        return real if self.speed == 1.0 else lambda: self.speed * real()


REAL_TIME: Final = Clock()
