"""Warnings about margins from a process of their own, so that a launcher needs no numerical libraries."""

import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from rcopterx.deploy.processes.forking import child_environment
from rcopterx.fleet.reading import encoded
from rcopterx.fleet.schema import FleetFile

NICE: Final = 5  # about a quarter of a processor that an ordinary program uses as well


def start_in_background(command: Sequence[str]) -> "subprocess.Popen[bytes]":
    """Start a program with pipes in a session of its own: Ctrl-C does not end it. May raise `OSError`."""
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        command, stdin=pipe, stdout=pipe, stderr=pipe, env=child_environment(), start_new_session=True
    )
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process.pid, NICE)
        # Linux shares processors among sessions first (autogroups), whose nice values are their own.
        Path(f"/proc/{process.pid}/autogroup").write_text(str(NICE), encoding="ascii")
    return process


def warnings_apart(fleet: FleetFile) -> list[str]:
    """`margins.configured_warnings` from another process; a line with the reason if it fails."""
    try:
        with start_in_background(
            [sys.executable, "-m", "rcopterx.ground_station.terminal.margins"]
        ) as process:
            output, complaint = process.communicate(encoded(fleet))
    except OSError as error:
        return [f"margins are not known: {error}"]
    if process.returncode:
        return [f"margins are not known: {complaint.decode(errors='replace').strip()}"]
    return output.decode().splitlines()
