"""Programs that take a processor from a fleet, at real-time priority."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

PRIORITY: Final = 50  # SCHED_FIFO priority above all of a fleet
SPIN_UNTIL: Final = """
import sys, time
end_s = float(sys.argv[1])
while time.monotonic() < end_s:
    pass
"""


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
