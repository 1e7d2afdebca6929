"""Programs in the background, which get the processor time that people and vehicles leave."""

import os
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from rcopterx.deploy.processes.forking import child_environment

NICE: Final = 5
"""About a quarter of a processor that an ordinary program uses as well."""


def start_in_background(command: Sequence[str]) -> "subprocess.Popen[bytes]":
    """Start a program with pipes for its standard streams, in a session of its own: Ctrl-C does not end it.

    Raises `OSError`: it cannot be started.
    """
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        command, stdin=pipe, stdout=pipe, stderr=pipe, env=child_environment(), start_new_session=True
    )
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process.pid, NICE)
        # Linux shares processors among sessions first (autogroups), whose nice values are their own.
        Path(f"/proc/{process.pid}/autogroup").write_text(str(NICE), encoding="ascii")
    return process
