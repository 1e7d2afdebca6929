"""When programs do what can wait: in the part of a frame's period in which no command is on its way."""

import math
import os
import threading
from collections.abc import Callable
from typing import Final

from rcopterx.bus.realtime import own_priority
from rcopterx.bus.receiving import Wake

BUSY_SHARE: Final = 0.5
"""Of a frame's period from its arrival on: agents compute, and commands travel to the radio."""
CALM_UNTIL_SHARE: Final = 0.85
"""The next frame has been taken, and travels, before it arrives here."""
LONGEST_PERIOD_S: Final = 0.1
"""Frames that are rarer leave processors and links calm for most of the time."""
LONGEST_CALM_S: Final = 0.03
"""How long after its time a calm wait may go on."""


def calm_at_s(due_s: float, arrived_s: float | None, period_s: float) -> float:
    """The earliest calm moment from the one on at which something is due.

    Parameters
    ----------
    due_s
        When it is due; minus infinity for what cannot wait.
    arrived_s, period_s
        Arrival and period of any frame; None and 0 before the first.

    Returns
    -------
    float
        At most the rest of a period later, whether further frames have arrived or not.
    """
    if arrived_s is None or due_s == -math.inf or not 0.0 < period_s <= LONGEST_PERIOD_S:
        return due_s
    into = (due_s - arrived_s) % period_s / period_s
    wait = BUSY_SHARE - into if into <= CALM_UNTIL_SHARE else 1.0 + BUSY_SHARE - into
    return due_s + max(0.0, wait * period_s)


class CalmWait:
    """Waits of a real-time thread that end when nobody computes who matters more, but not much later.

    The thread sleeps at a low priority and works at its own one, so that work that can wait a moment neither
    delays control nor is interrupted while it holds Python's lock. Without real-time rights it just waits.

    Parameters
    ----------
    calm_priority
        SCHED_FIFO priority while it waits; 0 for its own one.
    clock
        Monotonic clock [s].
    """

    def __init__(self, calm_priority: int, clock: Callable[[], float]) -> None:
        self._calm_priority = calm_priority
        self._clock = clock
        self._priority = 0
        self._thread: int | None = None
        self._due_s = math.inf

    def wait(self, wake: Wake, timeout_s: float) -> bool:
        """Wait, always on the same thread; whether it was woken before the time was over."""
        if self._thread is None:
            self._thread = threading.get_native_id()
            self._priority = own_priority() if self._calm_priority else 0
        if not self._priority:
            return wake.wait(timeout_s)
        self._due_s = self._clock() + timeout_s
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self._calm_priority))
        woken = wake.wait(timeout_s)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self._priority))
        self._due_s = math.inf
        return woken

    def hurry(self) -> None:
        """End a wait that is over by `LONGEST_CALM_S` and gets no processor; for any other thread."""
        if self._thread is not None and self._clock() > self._due_s + LONGEST_CALM_S:
            os.sched_setscheduler(self._thread, os.SCHED_FIFO, os.sched_param(self._priority))
