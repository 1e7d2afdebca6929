"""Programs that run while something is measured."""

import signal
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

STOP_S: Final = 30.0
"""Time that a program has to end before it is killed."""
Show = Callable[[str], None]
"""Shows a line about the progress of a benchmark."""


@contextmanager
def running(
    command: Sequence[str], end: signal.Signals = signal.SIGINT, **options: Any
) -> "Iterator[subprocess.Popen[Any]]":
    """Run a program until the block is left, which sends it the signal `end`.

    `options` are those of `subprocess.Popen`.
    """
    with subprocess.Popen(command, **options) as process:
        try:
            yield process
        finally:
            process.send_signal(end)
            try:
                process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()
