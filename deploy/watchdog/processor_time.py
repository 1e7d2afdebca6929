"""What the kernel (`/proc/PID/task/TID/stat`, `schedstat`) shows of a process that makes no progress."""

import os
from collections.abc import Mapping
from typing import Final, NamedTuple

from rcopterx.deploy.watchdog.watchdog import Excuse

STOPPED: Final = "T"
TRACED: Final = "t"
RUNNABLE: Final = "R"
IN_KERNEL: Final = "D"  # waits for a disk, swapped memory or a device, and cannot be killed meanwhile
SMALL_BYTES: Final = 4096
NS_PER_S: Final = 1e9
US_PER_S: Final = 1e6


class ThreadTime(NamedTuple):
    """State of a thread, and for how long it has run and has waited for a processor [s]."""

    state: str
    ran_s: float
    waited_s: float


Threads = Mapping[int, ThreadTime]  # threads of a process by thread id; the main one has the process id


def threads_of(process: int, proc: str = "/proc") -> Threads:
    """Read the threads of a process; empty for one that has ended, and without `schedstat`."""
    try:
        threads = [int(name) for name in os.listdir(f"{proc}/{process}/task")]
    except OSError:
        return {}
    times = {thread: _time_of(process, thread, proc) for thread in threads}
    return {thread: time for thread, time in times.items() if time is not None}


def pressure_s(proc: str = "/proc") -> float:
    """Return for how long any process of this computer has waited for a processor; 0 where unknown."""
    try:
        some = _read(f"{proc}/pressure/cpu").split(b"\n")[0]
        return int(some.rpartition(b"total=")[2]) / US_PER_S
    except (OSError, ValueError):
        return 0.0


def _time_of(process: int, thread: int, proc: str) -> ThreadTime | None:
    try:
        # The name of a program may contain anything; its last bracket ends it.
        state = _read(f"{proc}/{process}/task/{thread}/stat").rpartition(b")")[2].split()[0]
        ran, waited, _ = _read(f"{proc}/{process}/task/{thread}/schedstat").split()
        return ThreadTime(state.decode(), int(ran) / NS_PER_S, int(waited) / NS_PER_S)
    except (OSError, ValueError, IndexError):
        return None


def _read(path: str) -> bytes:
    with open(path, "rb", buffering=0) as file:
        return file.read(SMALL_BYTES)


def excuse_of(process: int, before: Threads, now: Threads, elapsed_s: float) -> Excuse:
    """Return what excuses a process without progress for `elapsed_s`, by the thread that waited longest."""
    main = now.get(process)
    state = "" if main is None else main.state
    waits = [_waited_s(before[thread], time, elapsed_s) for thread, time in now.items() if thread in before]
    return Excuse(
        waited_s=elapsed_s if state == IN_KERNEL else min(elapsed_s, max(waits, default=0.0)),
        stopped=state == STOPPED,
        traced=state == TRACED,
    )


def _waited_s(before: ThreadTime, now: ThreadTime, elapsed_s: float) -> float:
    """Return how long a thread has waited; the kernel counts a wait only when it has ended."""
    waited_s = now.waited_s - before.waited_s
    if now.state == RUNNABLE:
        waited_s = max(waited_s, elapsed_s - (now.ran_s - before.ran_s))
    return max(0.0, waited_s)
