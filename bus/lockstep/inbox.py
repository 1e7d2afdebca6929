"""What a process in lockstep receives under a key: it is kept until the turn in which it counts."""

import time
from collections.abc import Callable
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any, Final

from rcopterx.bus.attachments import STAMP, attached
from rcopterx.bus.lockstep.page import SentCounter

if TYPE_CHECKING:
    from rcopterx.bus.lockstep.participant import Participant

POLL_S: Final = 0.1  # real time between two checks for what wakes no process
Held = tuple[float, str, int, int, Callable[[], object]]
"""What has arrived: time of sending [s], key, number, number of the inbox; delivers it in its turn."""


class LockstepInbox:
    """What a process receives under a key, in which `*` is any unit; a `waking` one gives it turns."""

    def __init__(self, owner: "Participant", number: int, key: str, *, waking: bool) -> None:
        self._owner, self._number, self._since_s = owner, number, owner.page.now()
        self._waking = waking
        self._before, self._any, self._after = key.partition("*")
        self._slashes = key.count("/")
        self._received: dict[int, int] = {}
        self._counters: dict[int, SentCounter] = {}
        self._awaited = -1  # index of the counter that this process waits for

    def hold(self, on_arrival: Callable[[Any], object], arrived: Any) -> None:
        """Keep a sample or query for its turn, the next one if its sender takes no turns; any thread."""
        attachment, key = attached(arrived.attachment), str(arrived.key_expr)
        stamped = len(attachment) == STAMP.size
        number, counter, _, sent_s = STAMP.unpack(attachment) if stamped else (0, -1, 0, -inf)
        if not -inf < sent_s <= self._since_s:
            self._owner.held.append((sent_s, key, number, self._number, partial(on_arrival, arrived)))
        self._received[counter] = number
        if counter == self._awaited:
            self._owner.arrived.set()
        if not stamped:
            self._owner.call()

    def await_counter(self, index: int, counter: SentCounter, *, beyond: bool) -> None:
        """Wait for what another process sends, only beyond what it has sent if so requested."""
        name, before, after = counter.name.decode(), self._before, self._after
        matches = name == before
        if self._any:
            matches = name.startswith(before) and name.endswith(after) and name.count("/") == self._slashes
        if matches and counter.owner != self._owner.index:
            self._received.setdefault(index, counter.count if beyond else 0)
            self._counters[index] = counter
            if self._waking:
                self._owner.read(index)

    def await_all(self, give_up_s: float) -> None:
        """Wait until everything has arrived that was sent, or a router has lost it; real time."""
        # The newest first: when it is there, most of the others are.
        for index, counter in reversed(self._counters.items()):
            self._awaited = index
            while self._received[index] < counter.count:
                if self._owner.page.lost_routers and time.monotonic() > give_up_s:
                    self._received[index] = counter.count
                else:
                    self._owner.arrived.wait(POLL_S)
                    self._owner.arrived.clear()

    def end(self) -> None:
        """Receive no more."""
        self._owner.end(self)
