"""A bad network, simulated at the sender: messages are delayed, lost, doubled or reordered."""

import random
import sched
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from rcopterx.bus.session import Session

OVERTAKEN_S: Final = 0.03  # delay of a message that later ones overtake: more than a frame of 50 Hz


@dataclass
class Impairment:
    """Random delays of messages."""

    delay_s: float = 0.0  # of all messages
    # shares of the messages that are lost, sent twice, and overtaken by later ones
    loss: float = 0.0
    duplicates: float = 0.0
    reordering: float = 0.0
    seed: int = 0
    speed: float = 1.0  # how fast the time of the fleet passes

    def __post_init__(self) -> None:
        self._chance = random.Random(self.seed).random

    def delays_s(self) -> list[float]:
        """Delay of each copy of the next message in real time; empty for a lost one."""
        if self._chance() < self.loss:
            return []
        late_s = self.delay_s + (OVERTAKEN_S if self._chance() < self.reordering else 0.0)
        return [late_s / self.speed] * (2 if self._chance() < self.duplicates else 1)


class LateSender:
    """Calls functions later, in a thread of its own."""

    def __init__(self) -> None:
        # Quickly imported, unlike asyncio: vehicles fly meanwhile.
        self._scheduler = sched.scheduler(time.monotonic)
        self._added = threading.Event()
        threading.Thread(target=self._run, daemon=True).start()

    def call(self, after_s: float, function: Callable[[], None]) -> None:
        """Call a function after a time."""
        self._scheduler.enter(after_s, 0, function)
        self._added.set()

    def _run(self) -> None:
        while True:
            self._added.wait(self._scheduler.run(blocking=False))
            self._added.clear()


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
