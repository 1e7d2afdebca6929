"""Checks that processes make progress."""

from collections.abc import Mapping
from typing import NamedTuple

from rcopterx.bus.heartbeat import HeartbeatPage
from rcopterx.bus.processes import Duty
from rcopterx.deploy.watchdog.processor_time import Threads, excuse_of, pressure_s, threads_of
from rcopterx.deploy.watchdog.watchdog import Hung, ProcessObservation, Watchdog


class Watched(NamedTuple):
    """A process that is checked."""

    name: str  # also that of its successors
    page: HeartbeatPage
    duty: Duty


class Liveness:
    """Reads heartbeat pages and processor times for a watchdog."""

    def __init__(self, watchdog: Watchdog) -> None:
        self._watchdog = watchdog
        self._checked_s = 0.0
        self._pressure_s = pressure_s()
        self._threads: dict[int, Threads] = {}

    def check(self, now_s: float, processes: Mapping[int, Watched]) -> list[Hung]:
        """Check all processes, by process id; return those that hang and are to be killed."""
        elapsed_s, self._checked_s = now_s - self._checked_s, now_s
        pressure_before_s, self._pressure_s = self._pressure_s, pressure_s()
        pressed_s = min(elapsed_s, self._pressure_s - pressure_before_s)
        before, suspects = self._threads, self._watchdog.suspects
        # Not those of all processes: each read may pass the interpreter on to a thread that is slow.
        self._threads = {pid: threads_of(pid) if pid in suspects else {} for pid in processes}
        observations = {
            pid: ProcessObservation(
                name=process.name,
                duty=process.duty,
                beats=process.page.beats,
                phase=process.page.phase,
                excuse=excuse_of(pid, before.get(pid, {}), self._threads[pid], elapsed_s),
                pressed_s=pressed_s,
            )
            for pid, process in processes.items()
        }
        return self._watchdog.check(now_s, observations)
