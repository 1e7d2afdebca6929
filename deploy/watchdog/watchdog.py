"""Decides which processes hang: those whose loop could run for longer than their limit and made no progress.

Silence is the time without progress between checks, by the supervisor's clock. It does not include what is
not the fault of the process: waiting for a processor or in a driver, late checks (when the supervisor gets no
processor, others get none either), a debugger.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.bus.processes import Duty
from rcopterx.fleet.schema import WatchdogConfig

TIMELY_S: Final = 0.03  # longest time between checks in time; beyond, the supervisor is late
LATE_S: Final = 0.1  # a check that comes later than this after the last one is counted as late
SUSPECT: Final = 0.2  # share of the limit from which on the processor time of a silent process is read
LATE: Final = 0.4  # share of the limit from which on a silent process is late
PRESSED_SHARE: Final = 0.5  # of time spent waiting for processors that excuses a transmitter gateway
CROWD_LIMITS: Final = 4.0  # limits after which a process hangs although most others are silent as well
APART_S: Final = 0.5  # time after any kill in which no transmitter gateway is killed
AGAIN_S: Final = 5.0  # time after the kill of a transmitter gateway in which its successor is not killed


class Excuse(NamedTuple):
    """Why a process may have made no progress since the last check."""

    waited_s: float = 0.0  # time for which it could have run but had no processor, or waited in a driver
    stopped: bool = False  # a signal has stopped it: load is no explanation
    traced: bool = False  # a debugger has stopped it


class ProcessObservation(NamedTuple):
    """A process at a check."""

    name: str  # also that of its successors
    duty: Duty
    beats: int
    phase: LoopPhase
    excuse: Excuse = Excuse()
    pressed_s: float = 0.0  # how long processes have waited for a processor since the last check


def blamed_s(elapsed_s: float, seen: ProcessObservation) -> float:
    """Return for how much of the time between two checks a process without progress is to blame."""
    if seen.excuse.traced:
        return 0.0
    if seen.excuse.stopped:
        return elapsed_s
    # The loop of a gateway may wait for a process that waits, such as the kernel's for a serial line.
    pressed_s = PRESSED_SHARE * seen.pressed_s if seen.duty is Duty.RADIO else 0.0
    return max(0.0, min(elapsed_s, TIMELY_S) - max(seen.excuse.waited_s, pressed_s))


class Hung(NamedTuple):
    """A process that makes no progress, for how long, and its limit."""

    process: int
    silent_s: float
    limit_s: float


@dataclass
class _Watch:
    last: ProcessObservation
    limit_s: float
    silent_s: float = 0.0  # time without progress that counts
    elapsed_s: float = 0.0  # time without progress
    longest_s: float = 0.0
    condemned: bool = False

    def silent_for(self, share: float) -> bool:
        """Whether it has been silent for a share of its limit, and not been killed for it."""
        return not self.condemned and self.silent_s > share * self.limit_s

    def update(self, seen: ProcessObservation, elapsed_s: float, limit_s: float) -> bool:
        """Apply an observation; return whether the process was silent beyond its limit and goes on."""
        progress = (seen.beats, seen.phase) != (self.last.beats, self.last.phase)
        forgiven = progress and self.elapsed_s > self.limit_s
        self.last, self.limit_s = seen, limit_s
        if progress or seen.excuse.traced:
            self.silent_s = self.elapsed_s = 0.0
            return forgiven
        self.elapsed_s += elapsed_s
        self.silent_s += blamed_s(elapsed_s, seen)
        if seen.phase in (LoopPhase.WORKING, LoopPhase.FLYING):
            self.longest_s = max(self.longest_s, self.elapsed_s)
        return False

    def overdue(self, patience: float) -> bool:
        """Whether it hangs, with `patience` times its limit unless it was stopped."""
        return self.silent_for(1.0 if self.last.excuse.stopped else patience)


class Watchdog:
    """Checks the processes of a host; on a `blind` one vehicles may always fly."""

    def __init__(self, limits: WatchdogConfig, blind: bool = False) -> None:
        self._limits = limits
        self._blind = blind
        self._watches: dict[int, _Watch] = {}
        self._checked_s: float | None = None
        self._killed_s: dict[str, float] = {}
        self.forgiven: Counter[str] = Counter()  # how often a silence beyond the limit was no hang, by reason

    def check(self, now_s: float, observations: Mapping[int, ProcessObservation]) -> list[Hung]:
        """Return the processes to be killed now, each once; those missing in `observations` have ended."""
        elapsed_s = 0.0 if self._checked_s is None else now_s - self._checked_s
        self._checked_s = now_s
        if elapsed_s > LATE_S:
            self.forgiven["supervisor_late"] += 1
        flying = self._blind or any(seen.phase is LoopPhase.FLYING for seen in observations.values())
        known, self._watches = self._watches, {}
        for process, seen in observations.items():
            limit_s = self._limit_s(seen, flying)
            watch = self._watches[process] = known.get(process) or _Watch(seen, limit_s)
            if process in known and watch.update(seen, elapsed_s, limit_s):
                self.forgiven["load"] += 1
        patience = CROWD_LIMITS if self._crowd() else 1.0
        overdue = [item for item in self._watches.items() if item[1].overdue(patience)]
        hung = []
        for process, watch in sorted(overdue, key=lambda item: item[1].last.duty is Duty.RADIO):
            if self._may_be_killed(watch, now_s):
                watch.condemned = True
                self._killed_s[watch.last.name] = now_s
                hung.append(Hung(process, watch.silent_s, watch.limit_s))
        return hung

    def _limit_s(self, seen: ProcessObservation, flying: bool) -> float:
        starting = seen.phase is LoopPhase.STARTING and not seen.excuse.stopped
        if seen.duty is Duty.BACKGROUND or starting or seen.phase is LoopPhase.ENDING:
            return self._limits.start_s
        needed = seen.duty in (Duty.RADIO, Duty.FLIGHT)
        return self._limits.flight_s if flying and needed else self._limits.floor_s

    def _may_be_killed(self, watch: _Watch, now_s: float) -> bool:
        """Whether a kill is no mistake that load may explain: transmitter gateways come last, and seldom."""
        if watch.last.duty is not Duty.RADIO or watch.last.excuse.stopped:
            return True
        flying = (other for other in self._watches.values() if other.last.duty is Duty.FLIGHT)
        if any(other.silent_for(LATE) and other.limit_s <= watch.limit_s for other in flying):
            return False
        last_s = max(self._killed_s.values(), default=-math.inf)
        own_s = self._killed_s.get(watch.last.name, -math.inf)
        return now_s - last_s >= APART_S and now_s - own_s >= AGAIN_S

    @property
    def suspects(self) -> set[int]:
        """Processes whose processor time is to be read at the next check."""
        # One that starts may have been stopped.
        starting = SUSPECT * self._limits.flight_s / self._limits.start_s
        return {
            process
            for process, watch in self._watches.items()
            if watch.silent_for(starting if watch.last.phase is LoopPhase.STARTING else SUSPECT)
        }

    def silent_s(self, process: int) -> float:
        """Return how long a process has made no progress, 0 for an unknown one."""
        watch = self._watches.get(process)
        return 0.0 if watch is None else watch.silent_s

    def longest_s(self, process: int) -> float:
        """Return the longest silence of a working process, including what was excused."""
        watch = self._watches.get(process)
        return 0.0 if watch is None else watch.longest_s

    def _crowd(self) -> bool:
        """Whether at least two processes, and at least half of all, are silent without being stopped."""
        able = [watch for watch in self._watches.values() if not watch.last.excuse.stopped]
        late = sum(watch.silent_for(LATE) for watch in able)
        return late >= 2 and 2 * late >= len(able)
