"""What injectors and fault flights work with: the fleet, its processes, and how to wait."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.waiting import NotReachedError

POLL_S = 0.01


@dataclass(frozen=True)
class Bench:
    """A fleet in the simulated laboratory, and whoever looks on.

    Attributes
    ----------
    fleet
        The fleet, up.
    say
        Told what is done.
    wait
        Waits a time [s].
    fleet_file
        File it was started from, which may be broken; None for a fleet that was up before.
    """

    fleet: Fleet
    say: Callable[[str], None]
    wait: Callable[[float], None]
    fleet_file: Path | None = None

    @property
    def supervisor(self) -> Supervisor:
        """Supervisor of the fleet's processes.

        Raises
        ------
        NotReachedError
            This program did not start the fleet.
        """
        if self.fleet.launcher is None:
            raise NotReachedError("this program did not start the fleet; add --up")
        return self.fleet.launcher.supervisor

    def pid(self, process: str) -> int:
        """Process id.

        Raises
        ------
        NotReachedError
            It does not run.
        """
        known = process in self.supervisor.children
        pid = self.supervisor.pid(process) if known else None
        if pid is None:
            raise NotReachedError(f"{process} does not run")
        return pid

    def wait_for(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait until something holds, at most so long; whether it does."""
        for _ in range(round(seconds / POLL_S)):
            if condition():
                return True
            self.wait(POLL_S)
        return condition()


class Injector(Protocol):
    """Something that goes wrong. What ends by itself is over when the context is entered."""

    @property
    def launched(self) -> bool:
        """Whether it needs a fleet that this program has started."""
        ...

    def active(self, bench: Bench) -> AbstractContextManager[None]:
        """Let it go wrong until the context is left."""
        ...
