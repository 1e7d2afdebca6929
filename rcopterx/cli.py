"""Entry point of `rcopterx`: the command line, and a way round its imports for `kill`."""

import os
import sys

from rcopterx.bus.realtime import ONE_THREAD, request_realtime

KILL_PRIORITY = 60
"""SCHED_FIFO, where the operating system permits it: above every process of a fleet."""


def main() -> None:
    """Run the command that was typed."""
    if sys.argv[1:2] == ["kill"]:
        # A busy computer must not delay it, nor its imports.
        request_realtime(KILL_PRIORITY)
        from rcopterx import kill

        arguments = kill.parsed(sys.argv[2:])
        # Whatever is not plainly a kill, for instance --help, is left to the command line.
        if arguments is not None:
            sys.exit(kill.run(*arguments))
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    from rcopterx.command_line import app

    app()
