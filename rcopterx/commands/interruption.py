"""Ctrl-C as the normal end of a command, or of a flight."""

import math
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

POLL_S = 0.02  # longest time until a wait ends after a signal


class Interrupts(threading.Event):
    """Set by Ctrl-C, and counts it: the first one lands, the second one cuts."""

    def __init__(self) -> None:
        super().__init__()
        self.count = 0

    def __call__(self, *_: object) -> None:
        """Signal handler."""
        self.count += 1
        self.set()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait without the lock of `Event`, for which a signal during a wait would wait for ever."""
        end_s = math.inf if timeout is None else time.monotonic() + timeout
        while not self.is_set() and (left_s := end_s - time.monotonic()) > 0.0:
            time.sleep(min(left_s, POLL_S))
        return self.is_set()


def counted_interrupts() -> Interrupts:
    """Count Ctrl-C and signals that end a program from now on."""
    interrupts = Interrupts()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, interrupts)
    return interrupts


@contextmanager
def until_ctrl_c() -> Iterator[Interrupts]:
    """Leave the block at Ctrl-C, without an error; endless loops check whether an exception was lost."""
    interrupts = Interrupts()

    def interrupt(*_: object) -> None:
        interrupts()
        raise KeyboardInterrupt

    previous = signal.signal(signal.SIGINT, interrupt)
    try:
        with suppress(KeyboardInterrupt):
            yield interrupts
    finally:
        signal.signal(signal.SIGINT, previous)
