"""Calls of controllers and estimators, which may be plug-ins: they may fail or take too long.

Solvers that can stop early ask for the time limit of their call, all others are interrupted.
"""

import math
import signal
import time
from collections import Counter
from collections.abc import Callable
from typing import Final, TypeVar, TypeVarTuple

from rcopterx.user_text import described

SOLVER_SHARE: Final = 0.4  # share of the control period after which a solver that can stop early does so
STEP_SHARE: Final = 0.6  # of the control period, after which a controller's step is given up (12 of 20 ms)
LONGEST_WAIT_S: Final = 0.1  # longest duration of a call, shorter than the watchdog's limit
SHORTEST_ALARM_S: Final = 0.001
LONGEST_TEXT: Final = 300

T = TypeVar("T")
Arguments = TypeVarTuple("Arguments")


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


class GuardedCall:
    """Calls with a time limit whose failures are counted in `failures`, under names that begin with `part`.

    The first calls load code and fill caches, and may take `first_calls_factor` times as long.
    """

    def __init__(
        self, part: str, first_calls: int, first_calls_factor: float, failures: Counter[str] | None = None
    ) -> None:
        self.limit = TimeLimit()
        self.failures: Counter[str] = Counter() if failures is None else failures
        """Failures by kind: `..._raised`, `..._unusable`, `..._late`."""
        self.failure = ""  # description of the last failure; empty before the first one
        self._part = part
        self._first_calls, self._first_calls_factor = first_calls, first_calls_factor
        self._calls = 0

    def begin(self) -> None:
        """Allow the longer time of first calls again, because another object is called from now on."""
        self._calls = 0

    def allowed_s(self, limit_s: float) -> float:
        """Return the time that the next call may take where later ones may take `limit_s`."""
        return limit_s if self._calls >= self._first_calls else limit_s * self._first_calls_factor

    def attempt(
        self,
        name: str,
        limit_s: float,
        problem: Callable[[T], str | None],
        call: Callable[[*Arguments], T],
        *arguments: *Arguments,
    ) -> T | None:
        """Call something; return None after a failure, which is counted. `problem` says what is unusable."""
        limit, allowed_s = self.limit, self.allowed_s(limit_s)
        self._calls += 1
        try:
            try:
                limit.begin(allowed_s)
                result = call(*arguments)
                late = limit.end(allowed_s)
            except BaseException as error:
                # Also where the time ran out just when the call was over.
                limit.end(allowed_s)
                if not _interrupted(error):
                    raise
                late = True
            found = None if late else problem(result)
        except OutOfTimeError:
            # The alarm rang while an exception was handled.
            late = limit.end(allowed_s)
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            self.note("raised", f"{name}: {described(error)}")
            return None
        if late:
            self.note("late", f"{name}: a call took longer than {1e3 * allowed_s:.0f} ms")
        elif found is not None:
            self.note("unusable", f"{name}: {found}")
        else:
            return result
        return None

    def try_call(self, name: str, call: Callable[[*Arguments], None], *arguments: *Arguments) -> None:
        """Call something without a time limit; an exception is counted."""
        try:
            call(*arguments)
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            self.note("raised", f"{name}: {described(error)}")

    def note(self, kind: str, text: str) -> None:
        """Count a failure and keep its description."""
        self.failures[f"{self._part}_{kind}"] += 1
        self.failure = text[:LONGEST_TEXT]


def _interrupted(error: BaseException | None) -> bool:
    """Return whether an exception comes from `OutOfTimeError`, or a `SystemError` that it caused."""
    while isinstance(error, SystemError):
        error = error.__cause__
    return isinstance(error, OutOfTimeError)
