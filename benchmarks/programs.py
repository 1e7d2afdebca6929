"""Programs that run while something is measured."""

import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

STOP_S: Final = 30.0
"""An interrupted program is killed after it."""


@contextmanager
def running(command: Sequence[str], **options: Any) -> Iterator[None]:
    """Run a program until the block is left, which interrupts it.

    Parameters
    ----------
    command
        Its command line.
    options
        As for `subprocess.Popen`.
    """
    process = subprocess.Popen(command, **options)
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
