"""Ctrl-C as the normal end of a command, or of a flight."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass


@dataclass
class Interruption:
    """Whether Ctrl-C was pressed."""

    pressed: bool = False


@contextmanager
def until_ctrl_c() -> Iterator[Interruption]:
    """Leave the block at Ctrl-C, without an error; endless loops check the flag for a lost exception."""
    interruption = Interruption()

    def interrupt(*_: object) -> None:
        interruption.pressed = True
        raise KeyboardInterrupt

    previous = signal.signal(signal.SIGINT, interrupt)
    try:
        with suppress(KeyboardInterrupt):
            yield interruption
    finally:
        signal.signal(signal.SIGINT, previous)


class Interrupts(threading.Event):
    """Set by Ctrl-C, and counts it: the first one lands, the second one cuts."""

    def __init__(self) -> None:
        super().__init__()
        self.count = 0

    def __call__(self, *_: object) -> None:
        """Signal handler."""
        self.count += 1
        self.set()


def counted_interrupts() -> Interrupts:
    """Count Ctrl-C and signals that end a program from now on."""
    interrupts = Interrupts()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, interrupts)
    return interrupts
