"""Decides which processes hang: those whose loop shows no progress for longer than their limit.

Silence is counted from one look to the next, in time of the supervisor that looks. What keeps a process from
progress without its own fault does not count: a supervisor that was late itself (a suspended computer, heavy
load), time that a process waited for a processor, a debugger.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final, NamedTuple

from rcopterx.bus.heartbeat import Phase

LATE_S: Final = 0.1
"""A supervisor that looks later than this after its last look was itself kept from working."""
SUSPECT: Final = 0.4
"""Share of the limit from which on it is asked why a process is silent."""
CROWD_LIMITS: Final = 4.0
"""Limits after which a process hangs although most others are silent as well."""


class Duty(Enum):
    """What a process is there for; its limit depends on it."""

    FLIGHT = auto()
    """Vehicles in the air cannot do without it."""
    STANDBY = auto()
    """A spare process."""
    BACKGROUND = auto()
    """Vehicles in the air do not wait for it, as for the recorder, or a new simulator would not help them."""


@dataclass(frozen=True)
class WatchdogLimits:
    """For how long a process may show no progress.

    Attributes
    ----------
    flight_s
        While a rotor of the fleet is known to turn, or where nobody on this host knows.
    floor_s
        Otherwise; a spare process always.
    start_s
        While a process starts or ends; the simulator and the recorder always.
    """

    flight_s: float
    floor_s: float
    start_s: float

    def of(self, look: "Look", flying: bool) -> float:
        """Limit of a process."""
        if look.duty is Duty.BACKGROUND or look.phase in (Phase.STARTING, Phase.ENDING):
            return self.start_s
        return self.flight_s if flying and look.duty is Duty.FLIGHT else self.floor_s


class Look(NamedTuple):
    """What is seen of a process at a glance."""

    beats: int
    phase: Phase
    duty: Duty = Duty.FLIGHT


class Excuse(NamedTuple):
    """Why a process may have shown no progress since it was last asked.

    Attributes
    ----------
    waited_s
        How long it could have run and got no processor.
    stopped
        It was stopped by a signal, so that load explains nothing.
    traced
        A debugger holds it.
    """

    waited_s: float = 0.0
    stopped: bool = False
    traced: bool = False


class Hung(NamedTuple):
    """A process that shows no progress: after how long, and what its limit was."""

    process: int
    silent_s: float
    limit_s: float


@dataclass
class _Watch:
    look: Look
    silent_s: float = 0.0
    """Silence that counts."""
    elapsed_s: float = 0.0
    """All of it."""
    limit_s: float = math.inf
    """At the last look."""
    longest_s: float = 0.0
    stopped: bool = False
    condemned: bool = False

    @property
    def suspect(self) -> bool:
        """Whether it is time to ask why it is silent."""
        return self.silent_s > SUSPECT * self.limit_s

    def see(self, look: Look) -> None:
        """Begin to count anew."""
        self.look, self.silent_s, self.elapsed_s, self.stopped = look, 0.0, 0.0, False

    def overdue(self, patience: float) -> bool:
        """Whether it hangs, with so many times its limit; what was stopped gets no more than one."""
        return not self.condemned and self.silent_s > self.limit_s * (1.0 if self.stopped else patience)

    def condemn(self, process: int) -> Hung:
        """Say that it hangs, once."""
        self.condemned = True
        return Hung(process, self.silent_s, self.limit_s)


class Watchdog:
    """Looks at all processes of a host again and again.

    Parameters
    ----------
    limits
        How long processes may be silent.
    blind
        Nobody on this host knows whether vehicles fly, so that they always may.
    """

    def __init__(self, limits: WatchdogLimits, blind: bool = False) -> None:
        self._limits = limits
        self._blind = blind
        self._watches: dict[int, _Watch] = {}
        self._looked_s: float | None = None
        self.forgiven: Counter[str] = Counter()
        """How often a silence beyond the limit was no hang, by reason."""

    def check(self, now_s: float, looks: Mapping[int, Look], excuse: Callable[[int], Excuse]) -> list[Hung]:
        """Look once.

        Parameters
        ----------
        now_s
            Monotonic time of the supervisor.
        looks
            What is seen now, by process id. A process that is missing has ended.
        excuse
            Asked at every look for each process that has been silent for a good part of its limit.

        Returns
        -------
        list of Hung
            Processes that hang; each is named once.
        """
        elapsed_s = 0.0 if self._looked_s is None else now_s - self._looked_s
        self._looked_s = now_s
        self._watches = {
            process: self._watches.get(process) or _Watch(look) for process, look in looks.items()
        }
        if elapsed_s > LATE_S:
            self._forgive_all()
            elapsed_s = 0.0
        flying = self._blind or any(look.phase is Phase.FLYING for look in looks.values())
        for process, look in looks.items():
            if not self._progress(self._watches[process], look, self._limits.of(look, flying)):
                self._count(process, elapsed_s, excuse)
        patience = CROWD_LIMITS if self._crowd() else 1.0
        return [watch.condemn(process) for process, watch in self._watches.items() if watch.overdue(patience)]

    def silent_s(self, process: int) -> float:
        """How long a process has shown no progress, 0 for one that was never looked at."""
        watch = self._watches.get(process)
        return 0.0 if watch is None else watch.silent_s

    def longest_s(self, process: int) -> float:
        """Longest silence of a working process, with what was forgiven."""
        watch = self._watches.get(process)
        return 0.0 if watch is None else watch.longest_s

    def _forgive_all(self) -> None:
        self.forgiven["supervisor_late"] += 1
        for watch in self._watches.values():
            watch.see(watch.look)

    def _progress(self, watch: _Watch, look: Look, limit_s: float) -> bool:
        """Whether a process has shown progress since the last look."""
        silent_before_s, limit_before_s = watch.elapsed_s, watch.limit_s
        watch.limit_s = limit_s
        if look == watch.look:
            return False
        if silent_before_s > limit_before_s:
            self.forgiven["load"] += 1
        watch.see(look)
        return True

    def _count(self, process: int, elapsed_s: float, excuse: Callable[[int], Excuse]) -> None:
        """Count the time since the last look as silence, but for what excuses it."""
        watch = self._watches[process]
        watch.elapsed_s += elapsed_s
        watch.silent_s += elapsed_s
        if watch.look.phase in (Phase.WORKING, Phase.FLYING):
            watch.longest_s = max(watch.longest_s, watch.elapsed_s)
        if not watch.suspect:
            return
        reason = excuse(process)
        watch.stopped = reason.stopped
        if reason.traced:
            watch.see(watch.look)
        else:
            watch.silent_s -= min(elapsed_s, reason.waited_s)

    def _crowd(self) -> bool:
        """Whether at least two processes, and at least half of all, are silent without being stopped."""
        able = [watch for watch in self._watches.values() if not watch.stopped]
        late = sum(watch.suspect for watch in able)
        return late >= 2 and 2 * late >= len(able)
