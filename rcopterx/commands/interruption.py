"""Ctrl-C as the normal end of a command."""

import signal
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
