"""Wakes a loop that waits for serial ports when something arrives on the bus."""

import os
import select
from collections.abc import Iterable

from rcopterx.bus.clock import REAL_TIME, Clock


class Wakeup:
    """An event that `wait` watches together with file descriptors; its time-outs are those of a clock."""

    def __init__(self, clock: Clock = REAL_TIME) -> None:
        self._real_s = clock.real_s
        self._event = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

    def notify(self) -> None:
        """Wake the loop; may be called from any thread and from signal handlers."""
        os.eventfd_write(self._event, 1)

    def wait(self, descriptors: Iterable[int], timeout_s: float) -> set[int]:
        """Wait for a notification, for data or for the time-out; return readable or closed descriptors."""
        # `select` counts in microseconds; `poll` and `epoll` would round deadlines to milliseconds.
        readable, _, _ = select.select([self._event, *descriptors], [], [], max(0.0, self._real_s(timeout_s)))
        ready = set(readable)
        if self._event in ready:
            os.eventfd_read(self._event)
            ready.discard(self._event)
        return ready

    def close(self) -> None:
        """Release the descriptor."""
        os.close(self._event)
