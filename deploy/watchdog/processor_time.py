"""What the kernel knows of a process that makes no progress: stopped, traced, or waiting for a processor.

For each thread, `/proc/PID/task/TID/stat` has the state, and `schedstat` the times for which it has run and
has waited for a processor.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

from rcopterx.deploy.watchdog.watchdog import Excuse

STOPPED: Final = "T"
TRACED: Final = "t"
RUNNABLE: Final = "R"
NS_PER_S: Final = 1e9


class ThreadTime(NamedTuple):
    """State of a thread, and for how long it has run and has waited for a processor [s]."""

    state: str
    ran_s: float
    waited_s: float


Threads = Mapping[int, ThreadTime]
"""Threads of a process by thread id; that of the main thread is the process id."""


def threads_of(process: int, proc: Path = Path("/proc")) -> Threads:
    """Read the threads of a process; empty for one that has ended, and without `schedstat`."""
    found = {}
    try:
        tasks = list((proc / str(process) / "task").iterdir())
    except OSError:
        return {}
    for task in tasks:
        try:
            # The name of a program may contain anything; its last bracket ends it.
            state = (task / "stat").read_text().rpartition(")")[2].split()[0]
            ran, waited, _ = (task / "schedstat").read_text().split()
        except (OSError, ValueError, IndexError):
            continue
        found[int(task.name)] = ThreadTime(state, int(ran) / NS_PER_S, int(waited) / NS_PER_S)
    return found


def excuse_of(process: int, before: Threads, now: Threads, elapsed_s: float) -> Excuse:
    """Return what excuses a process for having made no progress between two readings, `elapsed_s` apart.

    `waited_s` is that of the thread that waited longest, because the loop may depend on any thread.
    """
    main = now.get(process)
    state = "" if main is None else main.state
    waits = [_waited_s(before[thread], time, elapsed_s) for thread, time in now.items() if thread in before]
    return Excuse(
        waited_s=min(elapsed_s, max(waits, default=0.0)),
        stopped=state == STOPPED,
        traced=state == TRACED,
    )


def _waited_s(before: ThreadTime, now: ThreadTime, elapsed_s: float) -> float:
    """Return how long a thread has waited; the kernel counts a wait only when it has ended."""
    waited_s = now.waited_s - before.waited_s
    if now.state == RUNNABLE:
        waited_s = max(waited_s, elapsed_s - (now.ran_s - before.ran_s))
    return max(0.0, waited_s)
