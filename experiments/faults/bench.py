"""The fleet that faults are injected into, and the base of the injectors."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.waiting import NotReachedError

POLL_S = 0.01


@dataclass(frozen=True)
class Bench:
    """A running fleet in the simulated laboratory."""

    fleet: Fleet
    say: Callable[[str], None]  # shows a line about what happens
    wait: Callable[[float], None]  # waits in the time of the fleet [s]
    # file it was started from, which faults may damage; None for a fleet that was up before
    fleet_file: Path | None = None

    def real_s(self, seconds: float) -> float:
        """Return the real time of a duration [s]."""
        return self.fleet.file.clock.real_s(seconds)

    @property
    def launcher(self) -> Launcher:
        """Launcher of the fleet.

        Raises `NotReachedError`: this program has not started the fleet.
        """
        if self.fleet.launcher is None:
            raise NotReachedError("this program did not start the fleet; add --up")
        return self.fleet.launcher

    @property
    def supervisor(self) -> Supervisor:
        """Supervisor of the fleet's processes; errors are those of `launcher`."""
        return self.launcher.supervisor

    def pid(self, process: str) -> int:
        """Process id.

        Raises `NotReachedError`: the process does not run.
        """
        known = process in self.supervisor.children
        pid = self.supervisor.pid(process) if known else None
        if pid is None:
            raise NotReachedError(f"{process} does not run")
        return pid

    def wait_for(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait until a condition holds, at most for a time; returns whether it does."""
        for _ in range(round(seconds / POLL_S)):
            if condition():
                return True
            self.wait(POLL_S)
        return condition()


class Injector(ABC):
    """A fault that can be injected into a flight."""

    launched: ClassVar[bool] = True  # whether it needs a fleet that this program has started

    def active(self, bench: Bench) -> AbstractContextManager[None]:
        """Inject the fault until the context is left."""
        return self._inject(bench)

    @abstractmethod
    def _inject(self, bench: Bench) -> AbstractContextManager[None]: ...


class PassingFault(Injector):
    """A fault that ends by itself; it is over when its context is entered."""

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        self._happen(bench)
        yield

    @abstractmethod
    def _happen(self, bench: Bench) -> None:
        """Inject the fault, and return when it is over."""
