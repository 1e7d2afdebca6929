"""The supervisor's side of the spare processes."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from rcopterx.bus.heartbeat import VARIABLE, HeartbeatPage, Phase
from rcopterx.bus.realtime import ONE_THREAD

Job = tuple[str, str]
"""Role and unit of a process."""
SPARES: Final = 2
"""Deaths in a row that find a warm successor."""


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
    """At most one process that can take over whatever must be back at once on this host.

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

    @property
    def pid(self) -> int | None:
        """Its process id, None while there is none."""
        return None if self._started is None else self._started.process.pid

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


class SpareProcesses:
    """Two spare processes, so that a death right after another one finds a successor as well.

    The second one is started once the first is ready: one start at a time is enough for the processor.

    Parameters
    ----------
    snapshot, jobs, log
        As for `SpareProcess`.
    """

    def __init__(self, snapshot: Path, jobs: Sequence[Job], log: Path) -> None:
        self._spares = tuple(SpareProcess(snapshot, jobs, log) for _ in range(SPARES))

    def prepare(self) -> None:
        """Start what is missing next.

        Raises
        ------
        OSError
            It cannot be started.
        """
        for spare in self._spares:
            spare.prepare()
            if not spare.ready():
                return

    def take(self, role: str, unit: str, log: Path, usable: Callable[[int], bool]) -> Started | None:
        """Let a spare that is ready, and usable by its process id, take over a job; None if there is none."""
        for spare in self._spares:
            pid = spare.pid
            started = spare.take(role, unit, log) if pid is not None and usable(pid) else None
            if started is not None:
                return started
        return None

    @property
    def pages(self) -> dict[int, HeartbeatPage]:
        """Page of each spare by its process id."""
        started = [spare.started for spare in self._spares]
        return {found.process.pid: found.page for found in started if found is not None}

    def ready(self) -> int:
        """How many could take over at this moment."""
        return sum(spare.ready() for spare in self._spares)

    def close(self) -> None:
        """End them all."""
        for spare in self._spares:
            spare.close()
