"""Scheduling and signals of a process; to be set before its first Zenoh session, whose threads inherit it."""

import gc
import os
import resource
import signal
import sys
from collections.abc import Iterable
from contextlib import suppress
from typing import Final

SPIN_LIMIT_S: Final = 5.0
"""Processor time of a real-time thread without any sleep after which the kernel ends its process (SIGXCPU,
then SIGKILL): the last resort where no launcher runs."""
SWITCH_INTERVAL_S = 0.0005
ONE_THREAD: Final = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Environment, set before the import of numerical libraries, in which they use one thread: for small matrices
more would only wait."""


def request_realtime(priority: int, *, process: int = 0, children: bool = True) -> bool:
    """Move a thread, and the ones it starts from now on, into the real-time class.

    `priority` 0 changes nothing; `process` 0 is this thread. Returns False without the permission, and where
    only one processor can be used: a thread that spins would leave nothing to all others.
    """
    if priority == 0 or len(os.sched_getaffinity(0)) == 1:
        return False
    try:
        policy = os.SCHED_FIFO if children else os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(process, policy, os.sched_param(priority))
    except OSError:
        return False
    if process == 0:
        _limit_spinning()
    return True


def leave_realtime(threads: Iterable[int] = (0,)) -> None:
    """Move threads, by default this one, and those they start from now on, back to the normal class."""
    for thread in threads:
        with suppress(ProcessLookupError):
            os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))


def _limit_spinning() -> None:
    """Let the kernel end this process, and the ones it starts, if one of their real-time threads spins."""
    limit_us = round(1e6 * SPIN_LIMIT_S)
    _, most_us = resource.getrlimit(resource.RLIMIT_RTTIME)
    hard_us = 2 * limit_us if most_us == resource.RLIM_INFINITY else min(2 * limit_us, most_us)
    resource.setrlimit(resource.RLIMIT_RTTIME, (min(limit_us, hard_us), hard_us))


def ending_signals() -> list[int]:
    """Collect SIGTERM and SIGINT from now on in the list that is returned."""
    # Not an event: the thread that a signal interrupts may hold its lock.
    signals: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda caught, _: signals.append(caught))
    return signals


def prepare_loop() -> None:
    """Shorten thread switches and disable garbage collection; to be called after start-up."""
    share_interpreter()
    gc.disable()


def share_interpreter() -> None:
    """Shorten for how long a thread may keep others from running; call it after start-up."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
