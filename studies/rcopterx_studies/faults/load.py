"""Programs that take processors from a fleet: busy ones, and bursts at real-time priority."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Final

PRIORITY: Final = 50  # SCHED_FIFO priority above all of a fleet
BURST_S: Final = 0.3
BURST_EVERY_S: Final = 4.0
CHECK_S: Final = 0.1
SPINNER: Final = """
import os, sys, time
os.setpriority(os.PRIO_PROCESS, 0, 0)
parent, busy_s, every_s = os.getppid(), *map(float, sys.argv[1:])
while os.getppid() == parent:
    now_s = time.monotonic()
    left_s = busy_s - now_s % every_s
    while time.monotonic() < now_s + left_s:
        pass
    if busy_s < every_s:
        time.sleep(every_s - time.monotonic() % every_s)
"""
"""Spins for a share of the time, at the same times as others of its kind, until its parent ends."""
SPIN_UNTIL: Final = """
import sys, time
end_s = float(sys.argv[1])
while time.monotonic() < end_s:
    pass
"""


@contextmanager
def spinning(
    busy_s: float = CHECK_S, every_s: float = CHECK_S, processor: int | None = None
) -> Iterator[bool]:
    """Run a program that spins for `busy_s` of `every_s`.

    With a processor it runs there alone, at real-time priority. Yields whether that is permitted; the program
    has the normal priority otherwise.
    """
    with subprocess.Popen([sys.executable, "-S", "-c", SPINNER, str(busy_s), str(every_s)]) as program:
        try:
            yield processor is not None and _take(program.pid, processor)
        finally:
            program.kill()


@contextmanager
def spinning_once(seconds: float, processor: int) -> Iterator[bool]:
    """Run a program that takes a processor for `seconds` from now on, and wait until it has ended.

    It ends by its own clock at real-time priority, because this process may wait for a processor longer than
    that; at the same time if another program of this kind has the processor first. Yields whether this
    priority is permitted.
    """
    end_s = time.monotonic() + seconds
    with subprocess.Popen([sys.executable, "-S", "-c", SPIN_UNTIL, str(end_s)]) as program:
        yield _take(program.pid, processor)


def _take(process: int, processor: int) -> bool:
    os.sched_setaffinity(process, {processor})
    try:
        os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        return False
    return True


@contextmanager
def loaded(busy: int, say: Callable[[str], None]) -> Iterator[None]:
    """Run busy programs, and bursts that take all processors; nothing for 0."""
    processors = os.sched_getaffinity(0) if busy else ()
    with ExitStack() as stack:
        for _ in range(busy):
            stack.enter_context(spinning())
        for processor in processors:
            if not stack.enter_context(spinning(BURST_S, BURST_EVERY_S, processor)):
                say("no permission for real-time priorities: bursts at normal priority")
        yield
