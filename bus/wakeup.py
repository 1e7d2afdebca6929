"""What ends the wait of a loop: a notification, data, or its time-out; in lockstep a turn."""

import os
import select
import time
from abc import ABC, abstractmethod
from collections.abc import Collection
from contextlib import suppress
from typing import TYPE_CHECKING

from rcopterx.bus.clock import REAL_TIME, Clock

if TYPE_CHECKING:
    from rcopterx.bus.lockstep.participant import Participant


class Waiter(ABC):
    """Waits in real time, unless a session in lockstep has set what takes turns instead."""

    scheduled: "Participant | None" = None

    def wait(self, timeout_s: float, descriptors: Collection[int] = (), rest_s: float = 0.0) -> set[int]:
        """Wait for a notification, data or the time-out [s]; return the readable or closed descriptors.

        In real time notifications and data end it only after `rest_s`.
        """
        if self.scheduled is not None:
            self.scheduled.before_wait()
            return self.scheduled.wait(timeout_s, descriptors)
        return self._wait(timeout_s, descriptors, rest_s)

    @abstractmethod
    def notify(self) -> None:
        """End the present wait, or else the next one; any thread and signal handler may call this."""

    @abstractmethod
    def _wait(self, timeout_s: float, descriptors: Collection[int], rest_s: float) -> set[int]:
        """See `wait`, in real time."""


class Wakeup(Waiter):
    """The waits of one loop; its time-outs are those of a clock."""

    def __init__(self, clock: Clock = REAL_TIME) -> None:
        self._real_s = clock.real_s
        self.event = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        """Descriptor of the notifications."""

    def notify(self) -> None:
        """See `Waiter`."""
        with suppress(OSError):  # it is closed
            os.eventfd_write(self.event, 1)

    def wait(self, timeout_s: float, descriptors: Collection[int] = (), rest_s: float = 0.0) -> set[int]:
        """See `Waiter`."""
        ready = super().wait(timeout_s, descriptors, rest_s)
        if self.event in ready:
            os.eventfd_read(self.event)
            ready.discard(self.event)
        return ready

    def _wait(self, timeout_s: float, descriptors: Collection[int], rest_s: float) -> set[int]:
        if rest_s > 0.0:
            time.sleep(self._real_s(rest_s))
            timeout_s -= rest_s
        # `select` counts in microseconds; `poll` and `epoll` would round deadlines to milliseconds.
        watched = {self.event, *descriptors}
        return set(select.select(watched, [], [], max(0.0, self._real_s(timeout_s)))[0])

    def close(self) -> None:
        """Release the descriptor."""
        event, self.event = self.event, -1
        os.close(event)
