"""The supervisor's side of the spare processes."""

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from rcopterx.bus.heartbeat import HeartbeatPage, Phase
from rcopterx.deploy.processes.forking import ForkServer, Started

Job = tuple[str, str]
"""Role and unit of a process."""
SPARES: Final = 3
"""Deaths in a row that find a warm successor, if they are of processes that everybody needs."""
NEEDED_BY_ALL: Final = ("router", "tracker", "transmitters")
"""Roles the last spare process is kept for: without one of them nobody is seen or nobody is heard, while a
vehicle without its agent is held and landed in a closed loop."""
WARMING_LIMIT_S: Final = 5.0
"""A spare process that needs longer is not waited for: it may have been stopped."""


def prefer(process: int, priority: int) -> None:
    """Let a process that takes over run in the real-time class, until it asks for its own priority.

    Parameters
    ----------
    process
        Its id.
    priority
        SCHED_FIFO priority; 0 leaves it as it is, and so does a lack of permission.
    """
    if priority:
        with suppress(OSError):
            os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(priority))


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
    forks
        Starts it.
    priority
        Real-time priority at which it begins to take over; 0 for none.
    host
        Where it is; empty for where the fleet file has its agents.
    clock
        Monotonic clock [s].
    """

    def __init__(
        self,
        snapshot: Path,
        jobs: Sequence[Job],
        log: Path,
        forks: ForkServer,
        priority: int = 0,
        host: str = "",
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._host = host
        self._clock = clock
        self._started_s = 0.0
        self._forks = forks
        self._snapshot = snapshot
        self._jobs = tuple(jobs)
        self._log = log
        self._priority = priority
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
        command = [
            sys.executable,
            "-m",
            "rcopterx.deploy.spares.spare",
            str(self._snapshot),
            self._host,
            *words,
        ]
        self._started = self._forks.start(command, self._log, piped=True)
        self._started_s = self._clock()

    def take(self, role: str, unit: str, log: Path, *, take_over: bool = False) -> Started | None:
        """Let the spare take over a job; None if that is none of its jobs or it is not ready.

        Parameters
        ----------
        role, unit, log
            The job, and where to write from now on.
        take_over
            Whether an agent shall take over from one that flies its vehicle.
        """
        started = self._started
        if (role, unit) not in self._jobs or started is None or not self.ready():
            return None
        words = {"role": role, "unit": unit, "log": str(log), "take_over": take_over}
        order = json.dumps(words) + "\n"
        prefer(started.process.pid, self._priority)
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

    def warming(self) -> bool:
        """Whether it was started a moment ago and is not ready yet."""
        started = self._started
        if started is None or started.process.poll() is not None or self.ready():
            return False
        return self._clock() - self._started_s < WARMING_LIMIT_S

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
    """Several spare processes, so that a death right after another one finds a successor as well.

    Each is started once those before it are ready, or take too long: one start at a time is enough for the
    processor.

    Parameters
    ----------
    spares
        They can all take over the same jobs.
    """

    def __init__(self, spares: Iterable[SpareProcess]) -> None:
        self._spares = tuple(spares)

    def prepare(self) -> None:
        """Start what is missing next.

        Raises
        ------
        OSError
            It cannot be started.
        """
        # First those that wait: a spare that died may be before one that is warming.
        if any(spare.warming() for spare in self._spares):
            return
        for spare in self._spares:
            spare.prepare()
            if spare.warming():
                return

    def take(
        self,
        role: str,
        unit: str,
        log: Path,
        usable: Callable[[int], bool],
        *,
        take_over: bool = False,
    ) -> Started | None:
        """Let a spare that is ready, and usable by its process id, take over a job; None if there is none.

        The last one is only for roles that everybody needs.
        """
        ready = [spare for spare in self._spares if spare.ready() and spare.pid and usable(spare.pid)]
        if len(ready) == 1 and role not in NEEDED_BY_ALL:
            return None
        for spare in ready:
            started = spare.take(role, unit, log, take_over=take_over)
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

    @property
    def complete(self) -> bool:
        """Whether all of them could."""
        return self.ready() == len(self._spares)

    def close(self) -> None:
        """End them all."""
        for spare in self._spares:
            spare.close()
