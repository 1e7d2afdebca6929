"""The clock of a fleet: the monotonic clock of its host, in a simulated laboratory also a multiple of it.

In lockstep all processes of a host read it from the same page of shared memory.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import floor
from pathlib import Path
from time import monotonic, time
from typing import TYPE_CHECKING, Final

from rcopterx.bus.rounding import TIME_BITS

if TYPE_CHECKING:
    from rcopterx.bus.lockstep.page import LockstepTime

NANO: Final = 1_000_000_000
"""Nanoseconds of a second."""
SLOWEST: Final = 0.01  # least speed; in lockstep that of limits in real time, as nothing has to be in time
_TICKS: Final = 2.0**TIME_BITS


@dataclass(frozen=True)
class Clock:
    """Time of a fleet, at `speed` times real time; in `lockstep` that of `page`, once its place is known."""

    speed: float = 1.0
    lockstep: bool = False
    page: Path | None = None

    @property
    def now(self) -> Callable[[], float]:
        """Function that returns the time of the fleet [s], in whole ticks of 2^-20 s."""
        if self.page is not None:
            # Imported here: no flight of hardware needs it.
            from rcopterx.bus.lockstep.page import opened_page

            return opened_page(self.page).now
        ticks = self.speed * _TICKS
        return lambda: floor(ticks * monotonic()) / _TICKS

    def lockstep_time(self) -> "LockstepTime | None":
        """Return the time that launchers let stand still for processes; None if it passes by itself."""
        if self.page is None:
            return None
        from rcopterx.bus.lockstep.page import LockstepTime

        return LockstepTime(self.page)

    def real_s(self, seconds: float) -> float:
        """Return the real time of a duration [s]."""
        return seconds / self.speed

    def wall_s(self) -> float:
        """Return the wall clock [s], in lockstep the time of the fleet."""
        return self.now() if self.lockstep else time()


LOCKSTEP: Final = Clock(SLOWEST, lockstep=True)
REAL_TIME: Final = Clock()
