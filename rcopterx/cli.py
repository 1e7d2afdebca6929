"""Entry point of `rcopterx`: `kill` runs without the imports of the command line."""

import os
import sys

from rcopterx.bus.realtime import ONE_THREAD, request_realtime

KILL_PRIORITY = 60  # SCHED_FIFO, where the operating system permits it: above every process of a fleet


def main() -> None:
    """Run the command that was typed."""
    if sys.argv[1:2] == ["kill"]:
        # Neither a busy computer nor imports may delay it.
        request_realtime(KILL_PRIORITY)
        from rcopterx import kill

        arguments = kill.parsed(sys.argv[2:])
        # Anything else than names and -f, for instance --help, is left to the command line.
        if arguments is not None:
            sys.exit(kill.run(*arguments))
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    from rcopterx.command_line import app

    app()
