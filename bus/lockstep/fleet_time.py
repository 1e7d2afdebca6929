"""What launchers do for the time of a fleet; only in lockstep there is anything to do."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from rcopterx.bus.clock import Clock

if TYPE_CHECKING:
    from rcopterx.bus.lockstep.page import LockstepTime


class FleetTime:
    """Time that passes by itself."""

    waits = False
    """Whether it waits for processes: then none of them hangs, and none has to be replaced at once."""
    lived_s: Callable[[str], float] | None = None
    """Returns, once, for how long a process that has died took turns [s]."""

    def begin(self, processes: Iterable[str]) -> None:
        """Begin when all these processes are there."""

    def want(self, process: str, wanted: bool) -> None:
        """Wait for a process that is started, or end one at the present time."""

    def note_lost_routers(self, count: int) -> None:
        """Pass without the messages that were lost with so many routers."""

    def want_none(self) -> None:
        """Pass without processes that are missing."""

    def end(self) -> None:
        """End; the processes have ended."""


def time_of(clock: Clock) -> "FleetTime | LockstepTime":
    """Return the time of a fleet with this clock."""
    if clock.page is None:
        return FleetTime()
    # Imported here: no flight of hardware needs it.
    from rcopterx.bus.lockstep.page import LockstepTime

    return LockstepTime(clock.page)
