"""Ctrl-C as the normal end of a command, or of a flight."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

POLL_S = 0.02  # longest time until a wait ends after a signal


class Interrupts:
    """Counts Ctrl-C: the first one lands, the second one cuts.

    It needs no lock: a signal handler that takes one waits for ever if the interrupted thread holds it.
    """

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, *_: object) -> None:
        """Signal handler."""
        self.count += 1

    def is_set(self) -> bool:
        """Return whether there was a signal."""
        return self.count > 0

    def wait(self, timeout_s: float, /) -> bool:
        """Wait for a signal for a time; return whether there was one."""
        end_s = time.monotonic() + timeout_s
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
