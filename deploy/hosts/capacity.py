"""Estimates how many vehicles a computer can fly, while its fleet waits for take-off.

A standing vehicle costs as much processor time as a flying one, except for its control periods. The processor
time of a standing fleet is read from the kernel, and control periods are timed in another process
(`control_time`). At a lower control rate a computer flies more.
"""

import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from rcopterx.agents.load import Relief
from rcopterx.bus.processes import AGENT
from rcopterx.deploy.processes.forking import ForkedProcess, ForkServer
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.deploy.watchdog.processor_time import Threads, threads_of

MODULE: Final = "rcopterx.deploy.hosts.control_time"
USABLE: Final = 0.65  # share of the processors beyond which control periods are missed
USABLE_AT_MOST: Final = 0.75  # beyond, at the lowest control rate, serial lines starve
SURE: Final = 1.5  # vehicles for each processor that any computer can fly
STANDING_S: Final = 3.0  # how long the processor time of the standing fleet is measured
LIMIT_S: Final = 120.0
MEASURE_S: Final = 0.1  # between two steps of a measurement

Roles = Mapping[int, str]  # roles of processes by process id


def vehicles_flown(
    standing_share: float, control_s: float, period_s: float, processors: int
) -> tuple[int, ...]:
    """Estimate how many vehicles a computer flies without missing control periods.

    The numbers are those with every control period computed, with one of two, and so on; the last one is the
    most that the computer flies at all.

    `standing_share`: share of one processor that all processes together use for each standing vehicle.
    `control_s`: processor time of a control period.
    """
    shares = [standing_share + control_s / (every * period_s) for every in range(1, max(Relief).every + 1)]
    at_most = max(USABLE_AT_MOST * processors / shares[-1], SURE * processors)
    return *(int(USABLE * processors / share) for share in shares[:-1]), int(at_most)


class CapacityMeasurement:
    """Measures once, in steps that take no longer than starting a process."""

    def __init__(
        self,
        snapshot: Path,  # snapshot of the fleet file
        # vehicle whose control periods are timed, and its control period in real time
        vehicle: str,
        period_s: float,
        forks: ForkServer,  # starts the process that times them
        roles: Callable[[], Roles],  # returns the processes of the fleet that run here now
        clock: Callable[[], float] = time.monotonic,  # monotonic clock [s]
    ) -> None:
        self._snapshot, self._vehicle, self._period_s = snapshot, vehicle, period_s
        self._forks, self._roles, self._clock = forks, roles, clock
        self._output = snapshot.with_suffix(".capacity")
        self._process: ForkedProcess | None = None
        self._began_s = 0.0
        self._before: dict[int, Threads] = {}
        self._standing_share: float | None = None
        self._late = False
        self.done = False  # whether the measurement has ended, with or without success

    def step(self, ready: bool, late: bool = False) -> tuple[int, ...] | str | None:
        """Start the measurement when the computer is ready for it, and later collect the result.

        `ready`: whether all processes have started and no vehicle flies; if that changes, the measurement is
        begun again later. `late`: whether commands of an agent are late. Processes that wait for processors
        use less than they need; so the result assumes that those which run need all, and is measured again.
        Returns the numbers of `vehicles_flown`, or why they are not known; None before and after.
        """
        if self.done:
            return None
        try:
            if not ready:
                self._abandon()
                return None
            self._late |= late
            if self._process is None:
                if AGENT in self._roles().values():
                    self._begin()
                return None
            result: tuple[int, ...] | str | None = self._result(self._process)
            if result is None:
                return None
        except (OSError, ValueError) as error:
            result = f"how many vehicles this computer flies cannot be measured: {error}"
        again = self._late and not isinstance(result, str)
        self._abandon()
        self.done = not again
        return result

    def _begin(self) -> None:
        command = [sys.executable, "-m", MODULE, str(self._snapshot), self._vehicle]
        self._process = self._forks.start(command, self._output)
        self._began_s = self._clock()
        self._before = {process: threads_of(process) for process in self._roles()}

    def _result(self, process: ForkedProcess) -> tuple[int, ...] | None:
        """Return the numbers of vehicles; None while the measurement is under way."""
        elapsed_s = self._clock() - self._began_s
        if self._standing_share is None and elapsed_s >= STANDING_S:
            self._standing_share = self._share_per_vehicle(elapsed_s)
        code = process.poll()
        if code is None and elapsed_s >= LIMIT_S:
            raise OSError(f"it takes more than {LIMIT_S:g} s")
        if code is None:
            return None
        output = self._output.read_text(encoding="utf-8", errors="replace").strip().rpartition("\n")[2]
        if code:
            raise OSError(f"exit code {code} {output}".strip())
        if self._standing_share is None:
            return None
        processors = len(os.sched_getaffinity(0))
        return vehicles_flown(self._standing_share, float(output), self._period_s, processors)

    def _share_per_vehicle(self, elapsed_s: float) -> float:
        """Return the share of one processor for each vehicle whose agent has run all the time."""
        stayed = {process: role for process, role in self._roles().items() if process in self._before}
        if not (agents := sum(role == AGENT for role in stayed.values())):
            raise OSError("no agent runs")
        readings = ((self._before[process], threads_of(process)) for process in stayed)
        ran_s = sum(now[n].ran_s - before[n].ran_s for before, now in readings for n in now if n in before)
        needed_s = len(os.sched_getaffinity(0)) * elapsed_s if self._late else 0.0
        return max(ran_s, needed_s) / elapsed_s / agents

    def close(self) -> None:
        """End the measurement."""
        self.done = True
        self._abandon()

    def _abandon(self) -> None:
        self._standing_share, self._late = None, False
        if self._process is not None:
            if self._process.poll() is None:
                self._process.kill()
                self._process.wait()
            self._process = None
        self._output.unlink(missing_ok=True)


class HostCapacity:
    """How many vehicles a host flies, measured again as long as that may be too few.

    `begin` returns a new measurement; None where nothing has to be in time, or no agent runs from the start.
    """

    def __init__(self, supervisor: Supervisor, begin: Callable[[], CapacityMeasurement] | None) -> None:
        self._supervisor, self._begin = supervisor, begin
        self._measurement = None if begin is None else begin()
        self._due_s, self._problem = 0.0, ""
        self.flies: tuple[int, ...] = ()  # result of `vehicles_flown`, if known
        self.measuring = begin is not None and self._may_be_crowded()
        """Whether `flies` is being measured and may be less than what runs here; published from the first
        status on, so that no vehicle takes off before."""

    def _may_be_crowded(self) -> bool:
        """Whether this computer may be too slow for its agents."""
        children = self._supervisor.children.values()
        agents = sum(child.wanted and child.spec.role == AGENT for child in children)
        return agents > SURE * len(os.sched_getaffinity(0))

    def step(self, late: bool) -> list[str]:
        """Go on measuring; return a line if that fails for a new reason. See `CapacityMeasurement.step`."""
        if self._begin is None or self._measurement is None or time.monotonic() < self._due_s:
            return []
        self._due_s = time.monotonic() + MEASURE_S
        flying = self._supervisor.flying
        result = self._measurement.step(self._supervisor.spares.ready() > 0 and not flying, late)
        if isinstance(result, tuple):
            self.flies = result
        self.measuring = not (self.flies or flying) and self._may_be_crowded()
        if self.measuring and self._measurement.done:
            self._measurement = self._begin()
        if not isinstance(result, str) or result == self._problem:
            return []
        self._problem = result
        return [result]

    def close(self) -> None:
        """End the measurement."""
        if self._measurement is not None:
            self._measurement.close()
