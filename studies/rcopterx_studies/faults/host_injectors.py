"""Faults of a host: disk, descriptors, clock, files."""

import os
import resource
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from rcopterx_studies.faults.bench import Bench, Injector, PassingFault
from rcopterx_studies.faults.orders import give_order

INVALID = "name = [\n"


def _processes(bench: Bench, without: Collection[str] = ()) -> list[int]:
    """Ids of all processes of the fleet except those of some roles, spares included."""
    supervisor = bench.supervisor
    names = [name for name, child in supervisor.children.items() if child.spec.role not in without]
    pids = (*map(supervisor.pid, names), *supervisor.spares.processes)
    return [pid for pid in pids if pid is not None]


class DiskFull(PassingFault):
    """No process of the fleet except the launcher can write to files."""

    def _happen(self, bench: Bench) -> None:
        bench.say("no process can write to files")
        for pid in _processes(bench):
            _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, hard))


@dataclass(frozen=True)
class NoDescriptors(Injector):
    """A process can open no further descriptor."""

    process: str

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        pid = bench.pid(self.process)
        bench.say(f"{self.process}: no descriptors left")
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
class ClockStepped(PassingFault):
    """The wall clock of all processes steps by `offset_s`; the monotonic one does not."""

    offset_s: float

    def _happen(self, bench: Bench) -> None:
        bench.say(f"wall clock: {self.offset_s:+g} s")
        # The router uses no wall clock, and every signal that it handles ends it.
        for pid in _processes(bench, without=("router",)):
            give_order(pid, "step_clock", offset_s=self.offset_s)


class FleetFileBroken(Injector):
    """The fleet file is overwritten with invalid text."""

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        path = bench.fleet_file
        assert path is not None  # it is launched
        bench.say("the fleet file is invalid")
        text = path.read_text(encoding="utf-8")
        path.write_text(INVALID, encoding="utf-8")
        try:
            yield
        finally:
            path.write_text(text, encoding="utf-8")


class LogsGone(Injector):
    """The directory of the log files is moved away and replaced by a file."""

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        logs = bench.launcher.directory / "log"
        gone = logs.with_name("log-gone")
        bench.say("the directory of the logs is gone")
        logs.rename(gone)
        logs.touch()
        try:
            yield
        finally:
            logs.unlink()
            gone.rename(logs)
