"""Faults of processes: they die, stop, spin, get no processor, slow down, or do not start."""

import os
import signal
import threading
from collections.abc import Iterator, Set
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx_studies.faults.bench import Bench, Injector, PassingFault
from rcopterx_studies.faults.load import spinning_once
from rcopterx_studies.faults.orders import give_order

REPLACED_S = 20.0  # by then the watchdog has replaced a process
POLL_S = 0.005
SUCCESSOR_S = 1.0


@dataclass(frozen=True)
class ProcessFault(PassingFault):
    """A fault of a process of the fleet that ends by itself."""

    process: str


class Killed(ProcessFault):
    """The process gets SIGKILL."""

    def _happen(self, bench: Bench) -> None:
        bench.say(f"{self.process}: SIGKILL")
        os.kill(bench.pid(self.process), signal.SIGKILL)


@dataclass(frozen=True)
class Stopped(ProcessFault):
    """The process gets SIGSTOP, and SIGCONT after a time if it has not been replaced."""

    seconds: float

    def _happen(self, bench: Bench) -> None:
        pid = bench.pid(self.process)
        bench.say(f"{self.process}: SIGSTOP for {self.seconds:g} s")
        os.kill(pid, signal.SIGSTOP)
        try:
            bench.wait_for(lambda: bench.supervisor.pid(self.process) != pid, self.seconds)
        finally:
            _continue(bench, self.process, pid)


def _continue(bench: Bench, process: str, pid: int) -> None:
    """Continue a stopped process that has not been replaced."""
    if bench.supervisor.pid(process) == pid:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGCONT)


@dataclass(frozen=True)
class Starved(ProcessFault):
    """The process gets no processor: it may use one only, which another program takes."""

    seconds: float = 0.3

    def _happen(self, bench: Bench) -> None:
        pid, processors = bench.pid(self.process), os.sched_getaffinity(0)
        taken = min(processors)
        _confine(pid, {taken})
        try:
            with spinning_once(self.seconds, taken) as alone:
                how = "no processor" if alone else "half a processor (no permission for real-time priorities)"
                bench.say(f"{self.process}: {how} for {self.seconds:g} s")
        finally:
            _confine(pid, processors)


def _confine(pid: int, processors: Set[int]) -> None:
    """Let the threads of a process, unless it has ended, run on some processors only."""
    with suppress(OSError):
        for thread in os.listdir(f"/proc/{pid}/task"):
            os.sched_setaffinity(int(thread), processors)


@dataclass(frozen=True)
class Pair(PassingFault):
    """Two faults, the second one a time after the first one; of one process, then of its successor."""

    first: ProcessFault
    second: ProcessFault
    apart_s: float

    def _happen(self, bench: Bench) -> None:
        process = self.second.process
        before = bench.pid(process)
        earlier = (None, before) if process == self.first.process else (None,)
        with ThreadPoolExecutor(max_workers=1) as pool:
            first = pool.submit(self.first._happen, bench)
            bench.wait(self.apart_s)
            bench.wait_for(lambda: bench.supervisor.pid(process) not in earlier, SUCCESSOR_S)
            self.second._happen(bench)
            first.result()


class Spinning(ProcessFault):
    """The working loop uses its processor and makes no progress."""

    def _happen(self, bench: Bench) -> None:
        pid = bench.pid(self.process)
        bench.say(f"{self.process}: spins")
        give_order(pid, "spin", seconds=bench.real_s(REPLACED_S))
        bench.wait_for(lambda: bench.supervisor.pid(self.process) != pid, REPLACED_S)


@dataclass(frozen=True)
class Slow(ProcessFault):
    """Every turn of the working loop takes longer."""

    by_s: float = 0.01
    seconds: float = 2.0

    def _happen(self, bench: Bench) -> None:
        pid = bench.pid(self.process)
        bench.say(f"{self.process}: every turn {1000 * self.by_s:g} ms longer for {self.seconds:g} s")
        give_order(pid, "slow", by_s=bench.real_s(self.by_s), seconds=bench.real_s(self.seconds))
        bench.wait(self.seconds)


@dataclass(frozen=True)
class Halting(ProcessFault):
    """The process is stopped again and again for `by_s` of `every_s`, which slows all of its threads."""

    by_s: float = 0.01
    every_s: float = 0.03
    seconds: float = 2.0

    def _happen(self, bench: Bench) -> None:
        pid = bench.pid(self.process)
        bench.say(f"{self.process}: stopped for {1000 * self.by_s:g} of {1000 * self.every_s:g} ms")
        clock = bench.fleet.session.clock
        until_s = clock() + self.seconds
        try:
            while clock() < until_s and bench.supervisor.pid(self.process) == pid:
                os.kill(pid, signal.SIGSTOP)
                bench.wait(self.by_s)
                os.kill(pid, signal.SIGCONT)
                bench.wait(self.every_s - self.by_s)
        finally:
            _continue(bench, self.process, pid)


@dataclass(frozen=True)
class DiesAtStart(Injector):
    """The process is killed, and so are its next successors as soon as they have started.

    With `successors` None all of them are killed, for `seconds` or until the flight is over.
    """

    process: str
    successors: int | None = 1
    seconds: float | None = None

    @contextmanager
    def _inject(self, bench: Bench) -> Iterator[None]:
        which = "every successor" if self.successors is None else f"{self.successors} successor(s)"
        bench.say(f"{self.process}: SIGKILL, and again {which} at its start")
        over = threading.Event()
        killer = threading.Thread(target=self._kill, args=(bench.supervisor, over))
        killer.start()
        try:
            if self.successors is not None:
                bench.wait_for(lambda: not killer.is_alive(), REPLACED_S)
            elif self.seconds is not None:
                bench.wait(self.seconds)
                over.set()
            yield
        finally:
            over.set()
            killer.join()

    def _kill(self, supervisor: Supervisor, over: threading.Event) -> None:
        killed: set[int] = set()
        while (self.successors is None or len(killed) <= self.successors) and not over.is_set():
            pid = supervisor.pid(self.process)
            if pid is not None and pid not in killed:
                killed.add(pid)
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            over.wait(POLL_S)
