"""The supervisor's side of the spare processes."""

import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.bus.processes import ROLES
from rcopterx.bus.realtime import request_realtime
from rcopterx.deploy.processes.forking import ForkedProcess, ForkServer

Job = tuple[str, str]  # role and unit of a process
SPARES: Final = 3  # deaths in a row after which a warm successor is ready (`Role.needed_by_all`: always)
WARMING_LIMIT_S: Final = 5.0  # one that takes longer, perhaps stopped, does not delay the next one


class _Spare(NamedTuple):
    process: ForkedProcess
    started_s: float

    def ready(self) -> bool:
        return self.process.poll() is None and self.process.page.phase is LoopPhase.WORKING

    def warming(self, now_s: float) -> bool:
        started_lately = now_s - self.started_s < WARMING_LIMIT_S
        return started_lately and self.process.poll() is None and not self.ready()

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        if self.process.stdin is not None:
            self.process.stdin.close()


def spare_command(snapshot: Path, host: str, jobs: Sequence[Job]) -> list[str]:
    """Command line of a spare that can take over any of these jobs on a host."""
    words = [f"{role}:{unit}" for role, unit in jobs]
    return [sys.executable, "-m", "rcopterx.deploy.spares.spare", str(snapshot), host, *words]


class Spares:
    """Spare processes that can each take over the same jobs, so that deaths in a row all find a successor."""

    def __init__(
        self,
        forks: ForkServer,
        jobs: Sequence[Job],  # processes that a spare can replace; without any there are no spares
        command: Sequence[str],  # command line of a spare
        log: Path,  # log file of spares until they take over
        count: int = SPARES,  # number of spares
        # SCHED_FIFO priority at which a spare takes over, until it sets its own; 0 for none
        priority: int = 0,
        clock: Callable[[], float] = time.monotonic,  # monotonic clock [s]
    ) -> None:
        self._forks, self._jobs, self._command, self._log = forks, jobs, command, log
        self._count = count if jobs else 0
        self._priority, self._clock = priority, clock
        self._spares: list[_Spare] = []

    def prepare(self) -> None:
        """Start the missing spares, each once all others are ready; `OSError` if one cannot be started."""
        for spare in [spare for spare in self._spares if spare.process.poll() is not None]:
            spare.end()
            self._spares.remove(spare)
        while len(self._spares) < self._count:
            now_s = self._clock()
            if any(spare.warming(now_s) for spare in self._spares):
                return
            process = self._forks.start(self._command, self._log, piped=True)
            self._spares.append(_Spare(process, now_s))

    def take(
        self, role: str, unit: str, log: Path, usable: Callable[[int], bool], *, take_over: bool = False
    ) -> ForkedProcess | None:
        """Let a spare that is `usable`, by its process id, take over a job; return its process, if any.

        It logs into `log`. With `take_over` an agent takes over from one that flies its vehicle.
        """
        if (role, unit) not in self._jobs:
            return None
        ready = [spare for spare in self._spares if spare.ready() and usable(spare.process.pid)]
        if len(ready) == 1 and not ROLES[role].needed_by_all:
            return None
        order = {"role": role, "unit": unit, "log": str(log), "take_over": take_over}
        for spare in ready:
            request_realtime(self._priority, process=spare.process.pid)
            assert spare.process.stdin is not None
            try:
                spare.process.stdin.write(json.dumps(order).encode() + b"\n")
                spare.process.stdin.close()
            except BrokenPipeError:
                continue
            self._spares.remove(spare)
            return spare.process
        return None

    @property
    def processes(self) -> dict[int, ForkedProcess]:
        """Process of each spare by its id, the one that is taken first at the beginning."""
        return {spare.process.pid: spare.process for spare in self._spares}

    def ready(self) -> int:
        """Number of spares that could take over now."""
        return sum(spare.ready() for spare in self._spares)

    @property
    def complete(self) -> bool:
        """Whether all spares could take over now."""
        return self.ready() == self._count

    def close(self) -> None:
        """End all spares."""
        for spare in self._spares:
            spare.end()
        self._spares.clear()
