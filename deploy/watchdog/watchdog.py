"""Decides which processes hang: those whose loop makes no progress for longer than their limit.

Silence is the time without progress between checks, by the supervisor's clock. It does not include what is
not the fault of the process: late checks (a suspended computer, heavy load), waiting for a processor, a
debugger.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final, NamedTuple

from rcopterx.bus.heartbeat import Phase

LATE_S: Final = 0.1
"""A check that comes later than this after the last one is late."""
SUSPECT: Final = 0.4
"""Share of the limit from which on the watchdog requests excuses of a silent process."""
CROWD_LIMITS: Final = 4.0
"""Limits after which a process hangs although most others are silent as well."""


class Duty(Enum):
    """Purpose of a process, on which its limit depends."""

    FLIGHT = auto()
    """Vehicles in the air need it."""
    STANDBY = auto()
    """A spare process."""
    BACKGROUND = auto()
    """Vehicles in the air do not need it (the recorder), or a new one does not help them (the simulator)."""


@dataclass(frozen=True)
class WatchdogLimits:
    """For how long a process may make no progress."""

    flight_s: float
    """While vehicles fly, or where no process of this host knows whether they do."""
    floor_s: float
    """Otherwise; always for spares."""
    start_s: float
    """While a process starts or ends; always for the simulator and the recorder."""

    def of(self, observation: "Observation", flying: bool) -> float:
        """Return the limit of a process."""
        if observation.duty is Duty.BACKGROUND or observation.phase in (Phase.STARTING, Phase.ENDING):
            return self.start_s
        return self.flight_s if flying and observation.duty is Duty.FLIGHT else self.floor_s


class Observation(NamedTuple):
    """Heartbeat of a process at a check."""

    beats: int
    phase: Phase
    duty: Duty = Duty.FLIGHT


class Excuse(NamedTuple):
    """Why a process may have made no progress since its last excuse."""

    waited_s: float = 0.0
    """Time for which it could have run but had no processor."""
    stopped: bool = False
    """A signal has stopped it: load is no explanation."""
    traced: bool = False
    """A debugger has stopped it."""


class Hung(NamedTuple):
    """A process that makes no progress, for how long, and its limit."""

    process: int
    silent_s: float
    limit_s: float


@dataclass
class _Watch:
    last: Observation
    silent_s: float = 0.0
    """Time without progress that counts."""
    elapsed_s: float = 0.0
    """Time without progress."""
    limit_s: float = math.inf
    longest_s: float = 0.0
    stopped: bool = False
    condemned: bool = False

    @property
    def suspect(self) -> bool:
        """Whether it is silent for a good part of its limit."""
        return self.silent_s > SUSPECT * self.limit_s

    def restart(self, observation: Observation) -> None:
        """Begin to count from now."""
        self.last, self.silent_s, self.elapsed_s, self.stopped = observation, 0.0, 0.0, False

    def overdue(self, patience: float) -> bool:
        """Whether it hangs, with `patience` times its limit unless it was stopped."""
        return not self.condemned and self.silent_s > self.limit_s * (1.0 if self.stopped else patience)


class Watchdog:
    """Checks all processes of a host again and again.

    Parameters
    ----------
    limits
        For how long processes may be silent.
    blind
        No process of this host knows whether vehicles fly, so that they always may.
    """

    def __init__(self, limits: WatchdogLimits, blind: bool = False) -> None:
        self._limits = limits
        self._blind = blind
        self._watches: dict[int, _Watch] = {}
        self._checked_s: float | None = None
        self.forgiven: Counter[str] = Counter()
        """How often a silence beyond the limit was no hang, by reason."""

    def check(
        self, now_s: float, observations: Mapping[int, Observation], excuse: Callable[[int], Excuse]
    ) -> list[Hung]:
        """Return the processes that are found to hang now; each is returned once.

        Parameters
        ----------
        now_s
            Monotonic time of the supervisor.
        observations
            By process id. A process that is missing has ended.
        excuse
            Called at every check for each process that has been silent for a good part of its limit.
        """
        elapsed_s = 0.0 if self._checked_s is None else now_s - self._checked_s
        self._checked_s = now_s
        self._watches = {
            process: self._watches.get(process) or _Watch(observation)
            for process, observation in observations.items()
        }
        if elapsed_s > LATE_S:
            self._forgive_all()
            elapsed_s = 0.0
        flying = self._blind or any(seen.phase is Phase.FLYING for seen in observations.values())
        for process, seen in observations.items():
            if not self._progress(self._watches[process], seen, self._limits.of(seen, flying)):
                self._count(process, elapsed_s, excuse)
        patience = CROWD_LIMITS if self._crowd() else 1.0
        hung = []
        for process, watch in self._watches.items():
            if watch.overdue(patience):
                watch.condemned = True
                hung.append(Hung(process, watch.silent_s, watch.limit_s))
        return hung

    def silent_s(self, process: int) -> float:
        """Return how long a process has made no progress, 0 for an unknown one."""
        watch = self._watches.get(process)
        return 0.0 if watch is None else watch.silent_s

    def longest_s(self, process: int) -> float:
        """Return the longest silence of a working process, including what was excused."""
        watch = self._watches.get(process)
        return 0.0 if watch is None else watch.longest_s

    def _forgive_all(self) -> None:
        self.forgiven["supervisor_late"] += 1
        for watch in self._watches.values():
            watch.restart(watch.last)

    def _progress(self, watch: _Watch, observation: Observation, limit_s: float) -> bool:
        """Whether a process has made progress since the last check."""
        silent_before_s, limit_before_s = watch.elapsed_s, watch.limit_s
        watch.limit_s = limit_s
        if observation == watch.last:
            return False
        if silent_before_s > limit_before_s:
            self.forgiven["load"] += 1
        watch.restart(observation)
        return True

    def _count(self, process: int, elapsed_s: float, excuse: Callable[[int], Excuse]) -> None:
        """Count the time since the last check as silence, except for what is excused."""
        watch = self._watches[process]
        watch.elapsed_s += elapsed_s
        watch.silent_s += elapsed_s
        if watch.last.phase in (Phase.WORKING, Phase.FLYING):
            watch.longest_s = max(watch.longest_s, watch.elapsed_s)
        if not watch.suspect:
            return
        reason = excuse(process)
        watch.stopped = reason.stopped
        if reason.traced:
            watch.restart(watch.last)
        else:
            watch.silent_s -= min(elapsed_s, reason.waited_s)

    def _crowd(self) -> bool:
        """Whether at least two processes, and at least half of all, are silent without being stopped."""
        able = [watch for watch in self._watches.values() if not watch.stopped]
        late = sum(watch.suspect for watch in able)
        return late >= 2 and 2 * late >= len(able)
