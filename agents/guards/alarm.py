"""The time limit of an agent process: a step that takes too long is interrupted by a signal.

What counts is the time that the processor worked on it, so that a busy machine without real-time priorities
makes nobody late; a step that only waits is interrupted as well, by the wall clock.
"""

import math
import signal
import time
from typing import Final

from rcopterx.agents.guards.time_limit import OutOfTimeError, TimeLimit

LONGEST_WAIT_S: Final = 0.1
"""Wall time of a step; shorter than what a watchdog takes for a hung process."""
SHORTEST_ALARM_S: Final = 0.001


class AlarmTimeLimit(TimeLimit):
    """Interrupts the main thread, in which it must be made and used.

    Python code is interrupted at once, a call of a library when it returns.
    """

    def __init__(self) -> None:
        self._limit_s = math.inf
        self._active = False
        self._begun_s = self._began_at_s = self._used_s = 0.0
        signal.signal(signal.SIGALRM, self._ring)

    def begin(self, limit_s: float) -> None:
        """See `TimeLimit.begin`."""
        self._limit_s = limit_s
        self._began_at_s, self._begun_s = time.monotonic(), time.thread_time()
        self._active = True
        if limit_s < math.inf:
            signal.setitimer(signal.ITIMER_REAL, limit_s)

    def end(self, limit_s: float) -> bool:
        """See `TimeLimit.end`; what was interrupted is over every limit."""
        if self._active:
            self._active = False
            self._used_s = time.thread_time() - self._begun_s
            if self._limit_s < math.inf:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
        return self._used_s > limit_s

    def over(self, limit_s: float) -> bool:
        """See `TimeLimit.over`; what was interrupted is over every limit."""
        return (time.thread_time() - self._begun_s if self._active else self._used_s) > limit_s

    def _ring(self, *_: object) -> None:
        if not self._active:
            return
        left_s = self._limit_s - (time.thread_time() - self._begun_s)
        waited_s = time.monotonic() - self._began_at_s
        if left_s <= 0.0 or waited_s >= LONGEST_WAIT_S:
            self._active, self._used_s = False, math.inf
            raise OutOfTimeError
        signal.setitimer(signal.ITIMER_REAL, max(min(left_s, LONGEST_WAIT_S - waited_s), SHORTEST_ALARM_S))
