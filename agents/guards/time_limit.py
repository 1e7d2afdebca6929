"""Time limits of calls: solvers that can stop early ask for them, all others are interrupted."""

import math
import signal
import time
from collections.abc import Iterable
from typing import Final

SOLVER_SHARE: Final = 0.4  # share of the control period after which a solver that can stop early does so
STEP_SHARE: Final = 0.6  # of the control period, after which a controller's step is given up (12 of 20 ms)
LONGEST_WAIT_S: Final = 0.1  # longest duration of a call, shorter than the watchdog's limit
SHORTEST_ALARM_S: Final = 0.001


class OutOfTimeError(BaseException):
    """A call took too long. No `Exception`: the code that it interrupts may catch all of those."""


class TimeLimit:
    """Time limit of the present call, which is what happens between `begin` and `end`.

    A call that takes longer is ended by `OutOfTimeError`, as far as possible. It may still be raised in
    `end`: the caller that catches it calls `end` again.

    This class never ends a call, for experiments, whose results must not depend on the speed of the machine.
    """

    def begin(self, limit_s: float) -> None:
        """Begin a call that may take `limit_s`."""

    def end(self, limit_s: float) -> bool:  # noqa: ARG002 - there is no limit
        """End the call; return whether it has used more time than `limit_s`."""
        return False

    def over(self, limit_s: float) -> bool:  # noqa: ARG002 - there is no limit
        """Return whether the present call has used more time than `limit_s`."""
        return False


class AlarmTimeLimit(TimeLimit):
    """Interrupts the main thread, in which it must be made and used, by a signal.

    Python code is interrupted at once, a call of a library when it returns. The limit counts the time that
    the processor works on the call, so that a busy machine without real-time priorities makes no call late;
    a call that only waits is interrupted as well, after `LONGEST_WAIT_S`. A call that was interrupted is over
    every limit. Limits are in the time of a fleet, which passes at `speed` times real time.
    """

    def __init__(self, speed: float = 1.0) -> None:
        self._speed = speed
        self._limit_s = math.inf
        self._active = False
        self._begun_s = self._began_at_s = self._used_s = 0.0
        signal.signal(signal.SIGALRM, self._ring)

    def begin(self, limit_s: float) -> None:
        """See `TimeLimit.begin`."""
        self._limit_s = limit_s / self._speed
        self._began_at_s, self._begun_s = time.monotonic(), time.thread_time()
        self._active = True
        if limit_s < math.inf:
            signal.setitimer(signal.ITIMER_REAL, self._limit_s)

    def end(self, limit_s: float) -> bool:
        """See `TimeLimit.end`."""
        if self._active:
            self._active = False
            self._used_s = time.thread_time() - self._begun_s
            if self._limit_s < math.inf:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
        return self._used_s > limit_s / self._speed

    def over(self, limit_s: float) -> bool:
        """See `TimeLimit.over`."""
        return (time.thread_time() - self._begun_s if self._active else self._used_s) > limit_s / self._speed

    def _ring(self, *_: object) -> None:
        if not self._active:
            return
        left_s = self._limit_s - (time.thread_time() - self._begun_s)
        patience_s = LONGEST_WAIT_S / self._speed - (time.monotonic() - self._began_at_s)
        if left_s <= 0.0 or patience_s <= 0.0:
            self._active, self._used_s = False, math.inf
            raise OutOfTimeError
        signal.setitimer(signal.ITIMER_REAL, max(min(left_s, patience_s), SHORTEST_ALARM_S))


Overtime = tuple[int, int]
"""Number of a call in a step, and number of the query `over` during it from which on its time was over; 0 if
that was found at its end."""


class NotedTimeLimit(TimeLimit):
    """Notes which calls of a step another limit found too long, and when, for a replay."""

    def __init__(self, limit: TimeLimit) -> None:
        self.overtime: list[Overtime] = []  # of the present step
        self._limit = limit
        self._calls = self._queries = 0
        self._was_over = False

    def begin_step(self) -> None:
        """Begin a step, with its first call."""
        self.overtime.clear()
        self._calls = 0

    def begin(self, limit_s: float) -> None:
        """See `TimeLimit.begin`."""
        self._calls += 1
        self._queries = 0
        self._was_over = False
        self._limit.begin(limit_s)

    def end(self, limit_s: float) -> bool:
        """See `TimeLimit.end`."""
        over = self._limit.end(limit_s)
        if over:
            self.overtime.append((self._calls, 0))
        return over

    def over(self, limit_s: float) -> bool:
        """See `TimeLimit.over`."""
        over = self._limit.over(limit_s)
        self._queries += 1
        if over and not self._was_over:
            self._was_over = True
            self.overtime.append((self._calls, self._queries))
        return over


class RepeatedTimeLimit(TimeLimit):
    """Repeats in a replay what a `NotedTimeLimit` has noted."""

    def __init__(self) -> None:
        self._noted: frozenset[Overtime] = frozenset()
        self._calls = self._queries = 0
        self._over = False

    def begin_step(self, overtime: Iterable[Overtime]) -> None:
        """Repeat this overtime in the next step."""
        self._noted = frozenset(overtime)
        self._calls = 0

    def begin(self, limit_s: float) -> None:  # noqa: ARG002 - the limit of the recording applies
        """See `TimeLimit.begin`."""
        self._calls += 1
        self._queries = 0
        self._over = False

    def end(self, limit_s: float) -> bool:  # noqa: ARG002 - the limit of the recording applies
        """See `TimeLimit.end`."""
        return (self._calls, 0) in self._noted

    def over(self, limit_s: float) -> bool:  # noqa: ARG002 - the limit of the recording applies
        """See `TimeLimit.over`."""
        self._queries += 1
        self._over = self._over or (self._calls, self._queries) in self._noted
        return self._over
