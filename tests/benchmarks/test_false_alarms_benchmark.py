"""Promises of the benchmark of false alarms: it counts what the watchdog did, and leaves no busy process."""

import os
from pathlib import Path

from support.waiting import wait_for

from rcopterx.benchmarks import false_alarms
from rcopterx.deploy.processes.forking import ForkServer
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.processes.table import ProcessSpec


def test_what_the_watchdog_ended_is_counted_by_process(tmp_path: Path) -> None:
    specs = [ProcessSpec(name, "simulator", "main", 0) for name in ("one", "two")]
    supervisor = Supervisor(specs, tmp_path / "lab.toml", tmp_path, ForkServer())
    assert not any(false_alarms.alarms(supervisor).values())
    supervisor.children["two"].hung = 2
    supervisor.children["two"].restarts = 3
    supervisor.spares_hung = 1
    found = false_alarms.alarms(supervisor)
    assert (found["hung"], found["restarts"], found["spares_hung"]) == ({"two": 2}, {"two": 3}, 1)


def test_busy_processes_use_a_processor_and_end_with_the_flight() -> None:
    def running() -> list[int]:
        return [pid for pid in children() if busy(pid)]

    def children() -> list[int]:
        text = Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="utf-8")
        return [int(word) for word in text.split()]

    def busy(pid: int) -> bool:
        return false_alarms.BUSY.encode() in Path(f"/proc/{pid}/cmdline").read_bytes()

    with false_alarms.busy_processes(2):
        wait_for(lambda: len(running()) == 2, "no busy processes")
    assert running() == []
