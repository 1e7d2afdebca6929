"""Programs that run while something is measured."""

import json
import signal
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

STOP_S: Final = 30.0
"""A program that was told to end is killed after it."""
_ROUTER: Final = """
import json, sys
from rcopterx.bus.requests import IdentifyReply
from rcopterx.bus.router import run_router
listen, connect, fleet, host, others = json.loads(sys.argv[1])
identity = IdentifyReply(accepted=True, fleet=fleet, host=host, digest="", vehicles=())
run_router(listen, connect, None, 26, identity, others)
"""


def router_words(
    listen: Sequence[str], connect: Sequence[str], fleet: str, host: str, others: Sequence[str]
) -> list[str]:
    """What Python is to be called with to be the router of a host; see `rcopterx.bus.router.run_router`."""
    return ["-c", _ROUTER, json.dumps([listen, connect, fleet, host, others])]


@contextmanager
def running(
    command: Sequence[str], end: signal.Signals = signal.SIGINT, **options: Any
) -> "Iterator[subprocess.Popen[Any]]":
    """Run a program until the block is left, which ends it.

    Parameters
    ----------
    command
        Its command line.
    end
        Signal that tells it to end; it is interrupted as by Ctrl-C if none is given.
    options
        As for `subprocess.Popen`.
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
