"""Processes that a process has started, and their memory and processor time (proc(5))."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

Show = Callable[[str], None]  # shows a line about the progress of a benchmark


def descendants(process: int, proc: Path = Path("/proc")) -> list[int]:
    """Processes that a process has started, directly or not (proc(5), field 4 of stat)."""
    children: dict[int, list[int]] = {}
    for entry in proc.glob("[0-9]*"):
        try:
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
        except (OSError, ValueError, IndexError):
            continue
        children.setdefault(parent, []).append(int(entry.name))
    found, waiting = [], [process]
    while waiting:
        started = children.get(waiting.pop(), [])
        found += started
        waiting += started
    return found


def memory_of(processes: Sequence[int], proc: Path = Path("/proc")) -> float:
    """Memory of processes together, shared pages counted once (PSS) [MB]; one that has ended has none."""
    total_kb = 0
    for process in processes:
        try:
            text = (proc / str(process) / "smaps_rollup").read_text()
        except OSError:
            continue
        total_kb += sum(int(line.split()[1]) for line in text.splitlines() if line.startswith("Pss:"))
    return total_kb / 1000


def cpu_s(pid: int) -> float:
    """Processor time of a process [s] (proc(5), fields 14 and 15 of stat)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def wake_ups(pid: int) -> int:
    """How often all threads of a process have waited and gone on (proc(5), task/TID/status)."""
    total = 0
    for status in Path(f"/proc/{pid}/task").glob("*/status"):
        try:
            lines = status.read_text().splitlines()
        except OSError:
            continue
        total += sum(int(line.split()[1]) for line in lines if line.startswith("voluntary_ctxt_switches"))
    return total
