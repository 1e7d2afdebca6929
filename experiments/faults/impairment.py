"""A bad network, simulated at the sender: messages are delayed, lost, doubled or reordered."""

import heapq
import itertools
import random
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from rcopterx.bus.session import Session

OVERTAKEN_S: Final = 0.03  # delay of a message that later ones overtake: more than a frame of 50 Hz


class Impairment:
    """Random delays of messages.

    `delay_s`: delay of all messages. `loss`, `duplicates` and `reordering`: shares of the messages that are
    lost, sent twice, and overtaken by later ones. `speed`: how fast the time of the fleet passes.
    """

    def __init__(
        self,
        delay_s: float = 0.0,
        loss: float = 0.0,
        duplicates: float = 0.0,
        reordering: float = 0.0,
        seed: int = 0,
        speed: float = 1.0,
    ) -> None:
        self._delay_s, self._speed = delay_s, speed
        self._loss = loss
        self._duplicates = duplicates
        self._reordering = reordering
        self._chance = random.Random(seed).random

    def delays_s(self) -> list[float]:
        """Delay of each copy of the next message in real time; empty for a lost one."""
        if self._chance() < self._loss:
            return []
        late_s = self._delay_s + (OVERTAKEN_S if self._chance() < self._reordering else 0.0)
        return [late_s / self._speed] * (2 if self._chance() < self._duplicates else 1)


class LateSender:
    """Calls functions later, in a thread of its own."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._queue: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._changed = threading.Condition()
        threading.Thread(target=self._run, daemon=True).start()

    def call(self, after_s: float, function: Callable[[], None]) -> None:
        """Call a function after a time."""
        with self._changed:
            heapq.heappush(self._queue, (self._clock() + after_s, next(self._order), function))
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: bool(self._queue))
                left_s = self._queue[0][0] - self._clock()
                if left_s > 0.0:
                    self._changed.wait(left_s)
                    continue
                function = heapq.heappop(self._queue)[2]
            function()


def impair(impairment: Impairment, seconds: float) -> None:
    """Impair everything this process publishes for some seconds."""
    publish, late, until_s = Session.publish, LateSender(), time.monotonic() + seconds

    def impaired(self: Session, channel: Any, unit: str, message: Any) -> None:
        if time.monotonic() >= until_s:
            Session.publish = publish  # type: ignore[method-assign]
            publish(self, channel, unit, message)
            return
        for late_s in impairment.delays_s():
            if late_s == 0.0:
                publish(self, channel, unit, message)
            else:
                late.call(late_s, lambda: publish(self, channel, unit, message))

    Session.publish = impaired  # type: ignore[method-assign]
