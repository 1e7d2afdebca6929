"""How many vehicles a computer flies, about, measured on it while its fleet waits for take-off.

A vehicle that stands costs what it costs in flight, except for its control periods: its agent hears and
filters, router, gateways and simulated laboratory pass everything on. So what all processes of a fleet take
while it stands is read from the kernel, and control periods are timed in a process that ends.
"""

import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from rcopterx.deploy.processes.forking import ForkedProcess, ForkServer
from rcopterx.deploy.watchdog.processor_time import Threads, threads_of

MODULE: Final = "rcopterx.deploy.hosts.control_time"
AGENT: Final = "agent"
USABLE: Final = 0.65
"""Share of the processors beyond which control periods are missed."""
SURE: Final = 3
"""So many vehicles for each processor are flown by any computer."""
STANDING_S: Final = 3.0
"""How long the processes of the fleet are watched."""
LIMIT_S: Final = 120.0

Roles = Mapping[int, str]
"""Roles of processes by their ids."""


def vehicles_flown(standing_share: float, control_s: float, period_s: float, processors: int) -> int:
    """About how many vehicles a computer flies without missing control periods, at least 0.

    Parameters
    ----------
    standing_share
        Of one processor that all processes take for each vehicle that stands.
    control_s
        Processor time of a control period.
    period_s
        Control period.
    processors
        How many there are.
    """
    return int(USABLE * processors / (standing_share + control_s / period_s))


def may_be_crowded(agents: int) -> bool:
    """Whether so many agents on this computer may be more than it serves."""
    return agents > SURE * len(os.sched_getaffinity(0))


class CapacityMeasurement:
    """Measures once, a step at each look, which takes no longer than starting a process.

    Parameters
    ----------
    snapshot
        Snapshot of the fleet file.
    vehicle, period_s
        Whose control periods are timed, and how long they are.
    forks
        Starts the process that times them.
    roles
        The processes of the fleet that run here now.
    clock
        Monotonic clock [s].
    """

    def __init__(
        self,
        snapshot: Path,
        vehicle: str,
        period_s: float,
        forks: ForkServer,
        roles: Callable[[], Roles],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._snapshot, self._vehicle, self._period_s = snapshot, vehicle, period_s
        self._forks, self._roles, self._clock = forks, roles, clock
        self._place: TemporaryDirectory[str] | None = None
        self._process: ForkedProcess | None = None
        self._began_s = 0.0
        self._before: dict[int, Threads] = {}
        self._standing_share: float | None = None
        self._done = False

    def look(self, ready: bool) -> int | str | None:
        """Begin when the computer has nothing else to do, later see whether the time is known.

        Parameters
        ----------
        ready
            Whether it has done what it does at the start, and nobody flies. If that ends meanwhile, what was
            measured is given up, to begin again: it would disturb, and not be true.

        Returns
        -------
        int, str or None
            Once the number of vehicles, or the reason why it is not known.
        """
        if self._done:
            return None
        try:
            if not ready:
                self._give_up()
                return None
            if self._process is None:
                if AGENT in self._roles().values():
                    self._begin()
                return None
            told: int | str | None = self._known(self._process)
            if told is None:
                return None
        except (OSError, ValueError) as error:
            told = f"how many vehicles this computer flies cannot be measured: {error}"
        self.close()
        return told

    def _begin(self) -> None:
        self._place = TemporaryDirectory(prefix="rcopterx-")
        command = [sys.executable, "-m", MODULE, str(self._snapshot), self._vehicle]
        self._process = self._forks.start(command, self._output).process
        self._began_s = self._clock()
        self._before = {process: threads_of(process) for process in self._roles()}

    @property
    def _output(self) -> Path:
        assert self._place is not None
        return Path(self._place.name) / "output"

    def _known(self, process: ForkedProcess) -> int | None:
        """The number of vehicles, None as long as something is missing."""
        elapsed_s = self._clock() - self._began_s
        if self._standing_share is None and elapsed_s >= STANDING_S:
            self._standing_share = self._share_per_vehicle(elapsed_s)
        code = process.poll()
        if code is None and elapsed_s >= LIMIT_S:
            raise OSError(f"it takes more than {LIMIT_S:g} s")
        if code is None:
            return None
        told = self._output.read_text(encoding="utf-8", errors="replace").strip().rpartition("\n")[2]
        if code:
            raise OSError(f"exit code {code} {told}".strip())
        if self._standing_share is None:
            return None
        processors = len(os.sched_getaffinity(0))
        return vehicles_flown(self._standing_share, float(told), self._period_s, processors)

    def _share_per_vehicle(self, elapsed_s: float) -> float:
        """Of one processor, for each vehicle whose agent has run all the time."""
        stayed = {process: role for process, role in self._roles().items() if process in self._before}
        agents = sum(role == AGENT for role in stayed.values())
        if not agents:
            raise OSError("no agent runs")
        ran_s = sum(_ran_s(self._before[process], threads_of(process)) for process in stayed)
        return ran_s / elapsed_s / agents

    @property
    def done(self) -> bool:
        """Whether nothing more is measured, with or without success."""
        return self._done

    def close(self) -> None:
        """Measure no more."""
        self._done = True
        self._give_up()

    def _give_up(self) -> None:
        self._standing_share = None
        if self._process is not None:
            if self._process.poll() is None:
                self._process.kill()
                self._process.wait()
            self._process = None
        if self._place is not None:
            self._place.cleanup()
            self._place = None


def _ran_s(before: Threads, now: Threads) -> float:
    """Processor time of the threads of a process between two readings [s]."""
    return sum(thread.ran_s - before[number].ran_s for number, thread in now.items() if number in before)
