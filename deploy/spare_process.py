"""The supervisor's side of the spare process."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from rcopterx.bus.heartbeat import VARIABLE, HeartbeatPage, Phase

Job = tuple[str, str]
"""Role and unit of a process."""


ONE_THREAD: Final = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Environment in which numerical libraries use one thread."""


def child_environment() -> dict[str, str]:
    """Environment of supervised processes: one thread per numerical library, and who the parent is."""
    return os.environ | {
        **ONE_THREAD,
        "RCOPTERX_PARENT": str(os.getpid()),
    }


class Started(NamedTuple):
    """A process and the page it beats into."""

    process: subprocess.Popen[bytes]
    page: HeartbeatPage


def start_process(command: Sequence[str], log: Path, stdin: int) -> Started:
    """Start a supervised process with a heartbeat.

    Parameters
    ----------
    command
        Command line.
    log
        File its output is appended to.
    stdin
        As for `subprocess.Popen`.

    Raises
    ------
    OSError
        It cannot be started, for instance for want of descriptors.
    """
    page = HeartbeatPage()
    try:
        with log.open("ab") as output:
            process = subprocess.Popen(
                command,
                stdin=stdin,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                pass_fds=[page.descriptor],
                env=child_environment() | {VARIABLE: str(page.descriptor)},
            )
    finally:
        page.handed_over()
    return Started(process, page)


class SpareProcess:
    """At most one spare process for what must be back at once on this host.

    Parameters
    ----------
    snapshot
        Snapshot of the fleet file handed to the spare.
    jobs
        Roles and units it must be able to take over; none means that there is never a spare.
    log
        Log file of the spare until it takes over.
    """

    def __init__(self, snapshot: Path, jobs: Sequence[Job], log: Path) -> None:
        self._snapshot = snapshot
        self._jobs = tuple(jobs)
        self._log = log
        self._started: Started | None = None

    @property
    def started(self) -> Started | None:
        """The spare, as long as there is one."""
        return self._started

    def prepare(self) -> None:
        """Start the spare if there is none."""
        if self._started is not None and self._started.process.poll() is None:
            return
        if not self._jobs:
            return
        self.close()
        words = [f"{role}:{unit}" for role, unit in self._jobs]
        command = [sys.executable, "-m", "rcopterx.deploy.spare", str(self._snapshot), *words]
        self._started = start_process(command, self._log, subprocess.PIPE)

    def take(self, role: str, unit: str, log: Path) -> Started | None:
        """Let the spare take over a job; None if that is none of its jobs or it is not ready."""
        started = self._started
        if (role, unit) not in self._jobs or started is None or not self.ready():
            return None
        order = json.dumps({"role": role, "unit": unit, "log": str(log)}) + "\n"
        stdin = started.process.stdin
        try:
            if stdin is not None:
                stdin.write(order.encode())
                stdin.close()
        except BrokenPipeError:
            return None
        self._started = None
        return started

    def ready(self) -> bool:
        """Whether the spare could take over at this moment."""
        started = self._started
        return started is not None and started.process.poll() is None and started.page.phase is Phase.WORKING

    def close(self) -> None:
        """End the spare."""
        if self._started is None:
            return
        process = self._started.process
        process.kill()
        process.wait()
        if process.stdin is not None:
            process.stdin.close()
        self._started = None
