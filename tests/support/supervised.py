"""Harmless processes under supervision, which do nothing but live and die."""

import os
import shlex
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import ProcessSpec
from rcopterx.fleet.schema import WatchdogConfig
from support.waiting import DEADLINE_S, wait_for

SLEEPS = "exec sleep 600"
# Of the clock, shorter than what a watchdog takes for a stall of its own.
READING_S = 0.02
LIMITS = WatchdogConfig(flight_s=0.5, floor_s=0.5, start_s=60.0)
BEATS = """
import mmap, os, sys, time
words = memoryview(mmap.mmap(int(os.environ["RCOPTERX_HEARTBEAT"]), 4096)).cast("Q")
spins = "spins" in sys.argv
if "in real time" in sys.argv:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
while True:
    words[0], words[1] = words[0] + 1, 1
    while spins and words[0] > 20:
        pass
    works_until_s = time.process_time() + (0.01 if "works" in sys.argv else 0.0)
    while time.process_time() < works_until_s:
        pass
    time.sleep(0.01)
"""
"""Shows progress; with an argument it spins after a while, or works 10 ms in each turn."""


@dataclass(frozen=True)
class Fake(ProcessSpec):
    """A process that runs a line of shell."""

    shell: str = SLEEPS

    def command(self, fleet_path: Path, *, take_over: bool = False) -> list[str]:
        return ["/bin/sh", "-c", self.shell, str(fleet_path)]


def beating(name: str, *words: str) -> Fake:
    shell = "exec " + shlex.join([sys.executable, "-S", "-c", BEATS, *words])
    return Fake(name, "tracker", "main", shell=shell)


def fake(name: str, shell: str = SLEEPS) -> Fake:
    return Fake(name, "simulator", "main", shell=shell)


Supervise = Callable[..., Supervisor]


def kill(supervisor: Supervisor, name: str, number: signal.Signals = signal.SIGKILL) -> int:
    pid = supervisor.pid(name)
    assert pid is not None
    os.kill(pid, number)
    return pid


def watch_until(
    supervisor: Supervisor, condition: Callable[[], object], what: str, deadline_s: float = DEADLINE_S
) -> list[str]:
    lines: list[str] = []

    def watched() -> bool:
        lines.extend(supervisor.watch(0.01))
        return bool(condition())

    wait_for(watched, what, deadline_s)
    return lines


def beats_of(supervisor: Supervisor, name: str) -> int:
    process = supervisor.children[name].process
    return 0 if process is None else process.page.beats
