"""Waiting for a condition, from any number of threads, until a deadline or a stop."""

import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol

from rcopterx.bus.session import Session
from rcopterx.bus.wakeup import Waiter

LOCKSTEP_START_S = 180.0  # real time in which the processes of a fleet in lockstep start
LONGEST_NAP_S = 0.1  # conditions that depend on the passing of time are checked this often


class NotReachedError(TimeoutError):
    """A condition did not become true in time; the text names what was missing."""


class StoppedError(NotReachedError):
    """A wait ended early because a stop was requested; see `stopped_by`."""


def begin_turns(session: Session) -> None:
    """Take turns once all other processes of the fleet are there; `NotReachedError` if some do not start."""
    try:
        session.begin(LOCKSTEP_START_S)
    except TimeoutError as error:
        raise NotReachedError(f"the fleet did not start: {error}") from None


class Stop(Protocol):
    """A request to stop, as an event or Ctrl-C."""

    def is_set(self) -> bool:
        """Return whether it was made."""

    def wait(self, timeout: float, /) -> bool:
        """Wait for it for a time [s]; return whether it was made."""


_STOP: ContextVar[Stop | None] = ContextVar("stop", default=None)


@contextmanager
def stopped_by(stop: Stop) -> Iterator[None]:
    """While the block runs, waits of this thread or task end with `StoppedError` once a stop is requested."""
    token = _STOP.set(stop)
    try:
        yield
    finally:
        _STOP.reset(token)


def arrived_after(time_s: float, age_s: float | None, now_s: float) -> bool:
    """Return whether a status of this age, None without one, arrived after a time."""
    return age_s is not None and now_s - age_s > time_s


class Notifier(Waiter):
    """Wakes every waiting thread when a message arrives; `clock` is monotonic [s]."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._condition = threading.Condition()
        self._notifications = 0
        self._waiting = threading.local()

    def notify(self) -> None:
        """Wake all waiting threads."""
        with self._condition:
            self._notifications += 1
            self._condition.notify_all()

    def wait_until(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until a condition holds, checked at every notification; return whether it held in time.

        Raises `StoppedError`: see `stopped_by`.
        """
        deadline_s = self._clock() + timeout_s
        stop = _STOP.get()
        while True:
            self._waiting.seen = self._notifications
            if condition():
                return True
            if stop is not None and stop.is_set():
                raise StoppedError("interrupted")
            left_s = deadline_s - self._clock()
            if left_s <= 0:
                return False
            self.wait(min(left_s, LONGEST_NAP_S))

    def _wait(self, timeout_s: float, _descriptors: Collection[int], _rest_s: float) -> set[int]:
        """Wait for a notification that this thread has not seen."""
        with self._condition:
            if self._notifications == self._waiting.seen:
                self._condition.wait(timeout_s)
        return set()
