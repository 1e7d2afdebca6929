"""Commands in processes of their own that look for their router for as long as a busy machine needs."""

import sys

from support.waiting import DEADLINE_S

CODE = """
from rcopterx.bus import session

opened = session.opened
session.opened = lambda address, _: opened(address, {patience_s})

from rcopterx.cli import main

main()
"""


def patient_command(*words: str) -> list[str]:
    """Command line of a command that joins a fleet."""
    return [sys.executable, "-c", CODE.format(patience_s=DEADLINE_S), *words]
