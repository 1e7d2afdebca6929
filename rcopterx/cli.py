"""Entry point of `rcopterx`: the command line, and a way round its imports for `kill`."""

import sys

from rcopterx import kill


def main() -> None:
    """Run the command that was typed."""
    if sys.argv[1:2] == ["kill"]:
        arguments = kill.parsed(sys.argv[2:])
        # Whatever is not plainly a kill, for instance --help, is left to the command line.
        if arguments is not None:
            sys.exit(kill.run(*arguments))
    from rcopterx.command_line import app

    app()
