"""Processes that a process has started, and their memory and processor time."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import psutil

Show = Callable[[str], None]  # shows a line about the progress of a benchmark


def descendants(process: int) -> list[int]:
    """Processes that a process has started, directly or not."""
    return [child.pid for child in psutil.Process(process).children(recursive=True)]


def memory_of(processes: Sequence[int]) -> float:
    """Memory of processes together, shared pages counted once (PSS) [MB]; one that has ended has none."""
    total = 0
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            total += psutil.Process(process).memory_full_info().pss
    return total / 1e6


def cpu_s(pid: int) -> float:
    """Processor time of a process [s]."""
    times = psutil.Process(pid).cpu_times()
    return float(times.user + times.system)


def wake_ups(pid: int) -> int:
    """How often all threads of a process have waited and gone on (proc(5), task/TID/status)."""
    total = 0
    for status in Path(f"/proc/{pid}/task").glob("*/status"):
        with suppress(OSError):
            lines = status.read_text().splitlines()
            total += sum(int(line.split()[1]) for line in lines if line.startswith("voluntary_ctxt_switches"))
    return total
