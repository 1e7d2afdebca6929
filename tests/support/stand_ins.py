"""Stand-ins for processes, which live and die as a test says, and for the fork server that starts them."""

import os
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import ProcessSpec
from rcopterx.deploy.spares.spares import Spares
from support.waiting import FakeClock

NO_PID = 5_000_000
"""Larger than any process id of Linux."""
JOBS = [("agent", "h1"), ("transmitters", "radio")]
"""What spares can do."""


@dataclass
class Page:
    """A heartbeat page that a test writes."""

    beats: int = 0
    phase: LoopPhase = LoopPhase.WORKING


@dataclass(eq=False)
class StandIn:
    """A process in the place of a `ForkedProcess`; a deaf one does not end at SIGTERM."""

    pid: int
    command: Sequence[str]
    log: Path
    deaf: bool = False
    immortal: bool = False
    """Whether it waits in the kernel, where SIGKILL does not end it."""
    page: Page = field(default_factory=Page)
    orders: list[bytes] = field(default_factory=list)
    """Lines on its standard input."""
    signals: list[str] = field(default_factory=list)
    code: int | None = None

    def __post_init__(self) -> None:
        self.stdin = SimpleNamespace(write=self.orders.append, close=lambda: None)
        self.descriptor = os.eventfd(0, os.EFD_CLOEXEC)
        weakref.finalize(self, os.close, self.descriptor)

    def end(self, code: int) -> None:
        self.code = code
        os.eventfd_write(self.descriptor, 1)

    def poll(self) -> int | None:
        return self.code

    def wait(self) -> int:
        assert self.code is not None
        return self.code

    def terminate(self) -> None:
        self.signals.append("TERM")
        if not self.deaf:
            self.end(0)

    def kill(self) -> None:
        self.signals.append("KILL")
        if not self.immortal:
            self.end(-9)

    def leave_realtime(self) -> None:
        self.signals.append("normal class")


class StandInForks(ForkServer):
    """Starts stand-ins, or raises `problem`; `checks` counts how often it was made sure that it runs."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[StandIn] = []
        self.problem: Exception | None = None
        self.checks = 0
        self.replaced = self.closed = False

    def ensure_running(self) -> bool:
        self.checks += 1
        if self.problem is not None:
            raise self.problem
        return self.replaced

    def start(self, command: Sequence[str], log: Path, *, piped: bool = False) -> Any:
        if self.problem is not None:
            raise self.problem
        self.started.append(StandIn(NO_PID + len(self.started), command, log))
        return self.started[-1]

    def close(self) -> None:
        self.closed = True


class SupervisedHost:
    """A supervisor of stand-ins, half a second after the computer has started."""

    def __init__(
        self,
        directory: Path,
        *specs: ProcessSpec,
        spares: int = 0,
        without: Sequence[str] = (),
        **options: Any,
    ) -> None:
        self.clock = FakeClock(0.5)
        self.logs = directory / "log"
        self.forks = StandInForks()
        self.spares = Spares(self.forks, JOBS, ["spare"], self.logs / "spare.log", spares, clock=self.clock)
        snapshot = directory / "elsewhere" / ".." / "lab.toml"
        self.supervisor = Supervisor(
            list(specs), snapshot, self.logs, self.forks, spares=self.spares, clock=self.clock, **options
        )
        for name in without:
            self.supervisor.children[name].wanted = False

    def start(self) -> None:
        assert self.supervisor.start_all() == []

    def turn(self, after_s: float = 0.0) -> list[str]:
        self.clock.advance(after_s)
        return self.supervisor.watch(0.0)

    def turns(self, seconds: float, *silent: StandIn, step_s: float = 0.02) -> list[str]:
        """Turns for a time, in which all processes but the silent ones make progress."""
        lines = []
        for _ in range(round(seconds / step_s)):
            for process in self.forks.started:
                process.page.beats += process not in silent
            lines += self.turn(step_s)
        return lines

    def __getitem__(self, name: str) -> StandIn:
        process: Any = self.supervisor.children[name].process
        assert process is not None, f"{name} does not run"
        return process


def spec(name: str, role: str = "agent", landing_s: float = 0.0) -> ProcessSpec:
    return ProcessSpec(name, role, "h1" if role == "agent" else "radio", landing_s=landing_s)
