"""Starts programs that nobody waits for, behind all that people and vehicles wait for."""

import os
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from rcopterx.deploy.processes.forking import child_environment

NICE: Final = 5
"""About a quarter of a processor that another program wants as well, and all of one that nobody wants."""


def begun_behind_others(command: Sequence[str]) -> "subprocess.Popen[bytes]":
    """Start a program in a session of its own, with pipes for its standard streams; Ctrl-C is not for it.

    Raises
    ------
    OSError
        It cannot be started.
    """
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        command, stdin=pipe, stdout=pipe, stderr=pipe, env=child_environment(), start_new_session=True
    )
    _set_back(process.pid)
    return process


def step_behind_others() -> None:
    """Set this process and its session back, as one that is begun behind others."""
    _set_back(os.getpid())


def _set_back(process: int) -> None:
    # It may have ended already, or another kernel may know no such groups.
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process, NICE)
        # Linux shares processors among sessions first (autogroups), whose nice values are their own.
        Path(f"/proc/{process}/autogroup").write_text(str(NICE), encoding="ascii")
