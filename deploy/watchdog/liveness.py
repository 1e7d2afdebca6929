"""Checks that processes make progress, and kills those that do not."""

import os
import signal
from collections.abc import Mapping
from contextlib import suppress

from rcopterx.bus.heartbeat import HeartbeatPage
from rcopterx.deploy.watchdog.processor_time import Threads, excuse_of, threads_of
from rcopterx.deploy.watchdog.watchdog import Duty, Excuse, Hung, Observation, Watchdog


class Liveness:
    """Reads heartbeat pages and thread times for a watchdog, and kills the processes that it finds hung."""

    def __init__(self, watchdog: Watchdog) -> None:
        self._watchdog = watchdog
        self._now_s = 0.0
        self._readings: dict[int, tuple[float, Threads]] = {}

    def check(self, now_s: float, pages: Mapping[int, tuple[HeartbeatPage, Duty]]) -> list[Hung]:
        """Check all processes, by process id; kill and return those that hang."""
        self._now_s = now_s
        self._readings = {pid: reading for pid, reading in self._readings.items() if pid in pages}
        observations = {pid: Observation(page.beats, page.phase, duty) for pid, (page, duty) in pages.items()}
        hung = self._watchdog.check(now_s, observations, self._excuse)
        for found in hung:
            with suppress(ProcessLookupError):
                os.kill(found.process, signal.SIGKILL)
        return hung

    def silent_s(self, process: int) -> float:
        """Return how long a process has shown no progress."""
        return self._watchdog.silent_s(process)

    def longest_s(self, process: int) -> float:
        """Return the longest silence of a process since it began to work."""
        return self._watchdog.longest_s(process)

    @property
    def forgiven(self) -> dict[str, int]:
        """How often a silence beyond the limit was no hang, by reason."""
        return dict(self._watchdog.forgiven)

    def _excuse(self, process: int) -> Excuse:
        threads = threads_of(process)
        before_s, before = self._readings.get(process, (self._now_s, {}))
        self._readings[process] = (self._now_s, threads)
        return excuse_of(process, before, threads, self._now_s - before_s)
