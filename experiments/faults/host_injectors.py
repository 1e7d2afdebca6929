"""What goes wrong with a host: disk, descriptors, clock, files."""

import os
import resource
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rcopterx.experiments.faults.bench import Bench
from rcopterx.experiments.faults.orders import give_order
from rcopterx.ground_station.scripting.waiting import NotReachedError

NONSENSE = "name = [\n"


@dataclass(frozen=True)
class _OfHost:
    """Base of what happens to the host of a fleet that this program has started."""

    @property
    def launched(self) -> bool:
        """See `Injector.launched`."""
        return True


def _processes(bench: Bench, without: Collection[str] = ()) -> list[int]:
    """Process ids of all processes of the fleet but those of some roles, the spare ones as well."""
    supervisor = bench.supervisor
    names = [name for name, child in supervisor.children.items() if child.spec.role not in without]
    pids = (*map(supervisor.pid, names), *supervisor.spare_pids)
    return [pid for pid in pids if pid is not None]


class DiskFull(_OfHost):
    """No process of the fleet can write to files any more; the launcher can."""

    @contextmanager
    def active(self, bench: Bench) -> Iterator[None]:
        """See `Injector.active`."""
        bench.say("no file may grow any more")
        for pid in _processes(bench):
            _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, hard))
        yield


@dataclass(frozen=True)
class NoDescriptors(_OfHost):
    """A process, or the launcher, can open nothing more.

    Attributes
    ----------
    process
        Its name; None for the launcher.
    """

    process: str | None

    @contextmanager
    def active(self, bench: Bench) -> Iterator[None]:
        """See `Injector.active`."""
        pid = os.getpid() if self.process is None else bench.pid(self.process)
        bench.say(f"{self.process or 'launcher'}: no descriptors left")
        before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (_lowest_free(pid), before[1]))
        try:
            yield
        finally:
            if os.path.exists(f"/proc/{pid}"):
                resource.prlimit(pid, resource.RLIMIT_NOFILE, before)


def _lowest_free(pid: int) -> int:
    """Lowest descriptor that a process does not use."""
    used = {int(name) for name in os.listdir(f"/proc/{pid}/fd")}
    return next(number for number in range(len(used) + 1) if number not in used)


@dataclass(frozen=True)
class ClockStepped(_OfHost):
    """The wall clock of all processes steps; the monotonic one does not.

    Attributes
    ----------
    offset_s
        By how much.
    """

    offset_s: float

    @contextmanager
    def active(self, bench: Bench) -> Iterator[None]:
        """See `Injector.active`."""
        bench.say(f"wall clock: {self.offset_s:+g} s")
        # The router uses no wall clock, and every signal that it handles ends it.
        for pid in _processes(bench, without=("router",)):
            give_order(pid, "step_clock", offset_s=self.offset_s)
        yield


class FleetFileBroken(_OfHost):
    """Somebody saves nonsense over the fleet file."""

    @contextmanager
    def active(self, bench: Bench) -> Iterator[None]:
        """See `Injector.active`."""
        path = bench.fleet_file
        if path is None:
            raise NotReachedError("this program did not start the fleet; add --up")
        bench.say("the fleet file is nonsense")
        text = path.read_text(encoding="utf-8")
        path.write_text(NONSENSE, encoding="utf-8")
        try:
            yield
        finally:
            path.write_text(text, encoding="utf-8")


class LogsGone(_OfHost):
    """Somebody moves the directory of the log files away, and a file is in its place."""

    @contextmanager
    def active(self, bench: Bench) -> Iterator[None]:
        """See `Injector.active`."""
        if bench.fleet.launcher is None:
            raise NotReachedError("this program did not start the fleet; add --up")
        logs = bench.fleet.launcher.directory / "log"
        gone = logs.with_name("log-gone")
        bench.say("the directory of the logs is gone")
        logs.rename(gone)
        logs.touch()
        try:
            yield
        finally:
            logs.unlink()
            gone.rename(logs)
