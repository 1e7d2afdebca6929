"""What a fault flight needs: the fleet, a copy of its file, injectors; and its row of the table."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar, Final

import tomlkit

from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.waiting import NotReachedError
from rcopterx_studies.faults.promise import LIMITS, Promise, PromisedLimits

POLL_S: Final = 0.01
ENDURANCE_S: Final = 36_000.0  # of the simulated batteries, because one fleet flies many faults


@contextmanager
def copied_fleet(name: str, vehicles: int | None = None) -> Iterator[Path]:
    """Path of a copy of a fleet file, or of a shipped one, that is deleted afterwards.

    With `vehicles` it has only the first ones of the fleet. Raises `FleetError`: it cannot be used, or has no
    simulated laboratory.
    """
    path = fleet_path(name)
    if load_fleet(path).simulator is None:
        raise FleetError(f"{path}: faults are flown in the simulator only, and [simulator] is missing")
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    for vehicle in list(document["vehicles"])[vehicles:] if vehicles else ():
        del document["vehicles"][vehicle]
    document["simulator"].setdefault("condition_overrides", {})["battery_endurance_s"] = ENDURANCE_S
    with TemporaryDirectory(prefix="rcopterx-faults-") as directory:
        copy = Path(directory) / path.name
        copy.write_text(tomlkit.dumps(document), encoding="utf-8")
        yield copy


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
        """Launcher of the fleet; `NotReachedError`: this program has not started the fleet."""
        if self.fleet.launcher is None:
            raise NotReachedError("this program did not start the fleet; add --up")
        return self.fleet.launcher

    @property
    def supervisor(self) -> Supervisor:
        """Supervisor of the fleet's processes; errors are those of `launcher`."""
        return self.launcher.supervisor

    def pid(self, process: str) -> int:
        """Process id; `NotReachedError`: the process does not run."""
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


@dataclass(frozen=True)
class TakeOff:
    """A take-off that a fault is to end before the vehicle has risen."""

    vehicle: str
    after_s: float | None  # from the request to take off to the fault; None: it begins before
    cause: str  # pattern of the lines that name the cause


@dataclass(frozen=True)
class FaultFlight:
    """One row of the table of fault flights."""

    name: str
    title: str  # what happens, for reports
    faults: tuple[Injector, ...]  # injected one after the other; all of them until the flight is over
    promise: Promise = Promise.FLIES_ON
    down: tuple[str, ...] = ()  # vehicles that come down
    limits: PromisedLimits | None = None  # None for those of the promise
    # name and title of the row of the page that shows the worst of all flights that have it
    page_row: tuple[str, str] | None = None
    # the vehicles stand on the floor when the fault begins, and get a command to take off then
    on_floor: bool = False
    take_off: TakeOff | None = None  # of one vehicle, while the others stand
    fleet: Path | None = None  # file of the fleet that flies it; None for the one that is flown

    @property
    def on_page(self) -> tuple[str, str]:
        """Name and title of its row of the page."""
        return self.page_row or (self.name, self.title)

    @property
    def allowed(self) -> PromisedLimits:
        """Limits of the flight."""
        return self.limits or LIMITS[self.promise]

    @property
    def launched(self) -> bool:
        """Whether it needs a fleet that the same program has started."""
        return any(fault.launched for fault in self.faults)

    @contextmanager
    def injected(self, bench: Bench) -> Iterator[None]:
        """Inject the faults until the context is left."""
        with ExitStack() as stack:
            for fault in self.faults:
                stack.enter_context(fault.active(bench))
            yield
