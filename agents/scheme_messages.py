"""Messages of schemes on the bus, and when they are exchanged."""

import math
from collections import deque
from collections.abc import Mapping

import numpy as np

from rcopterx.agents.cooperation import Cooperation, Sent, Unpacked
from rcopterx.bus.external_messages import SchemeMessage
from rcopterx.bus.subscription import Inbox
from rcopterx.vehicles.state import three


def scheme_message(sent: Sent, source: str, epoch: int, frame: int) -> SchemeMessage:
    """Return what a vehicle publishes."""
    return SchemeMessage(
        epoch=epoch,
        frame=frame,
        source=source,
        scheme=sent.scheme,
        offsets_m={name: three(offset) for name, offset in sent.offsets_m.items()},
        payload=sent.payload,
    )


def unpacked(message: SchemeMessage, cooperation: Cooperation, age_s: float) -> Unpacked | None:
    """Unpack a message; None if it is of another scheme, or rejected and counted."""
    offset = message.offsets_m.get(cooperation.vehicle)
    offset_m = None if offset is None else np.array(offset)
    return cooperation.unpack(message.scheme, message.payload, offset_m, age_s)


def newest_messages(
    inboxes: Mapping[str, Inbox[SchemeMessage]], cooperation: Cooperation
) -> dict[str, Unpacked]:
    """Newest usable messages of other vehicles, of the present epoch."""
    clock, found = cooperation.clock, {}
    for name, inbox in tuple(inboxes.items()):
        newest = None if name == cooperation.vehicle else inbox.latest()
        if newest is not None and newest.message.epoch == clock.epoch:
            age_s = (clock.current_frame - newest.message.frame) * clock.period_s
            message = unpacked(newest.message, cooperation, max(age_s, 0.0))
            if message is not None:
                found[name] = message
    return found


class LaterExchanges:
    """The exchanges of a control period after its first one, evenly spread over it.

    Messages that arrive after their exchange count in the next one; exchanges that are due after the next
    period has begun are left out.
    """

    def __init__(self, cooperation: Cooperation) -> None:
        self._cooperation = cooperation
        self._began_s = 0.0
        self._left_s: deque[float] = deque()  # times after the beginning of the period

    @property
    def due_s(self) -> float:
        """Time of the next one [s]."""
        return self._began_s + self._left_s[0] if self._left_s else math.inf

    def begin_period(self, began_s: float) -> None:
        """Begin a control period, whose pose arrived at a time, after its first exchange."""
        scheme, count = self._cooperation.scheme, self._cooperation.exchanges
        self._began_s = began_s
        self._left_s.clear()
        if scheme is not None:
            self._left_s.extend(number * scheme.period_s / count for number in range(1, count))

    def exchange(self, inboxes: Mapping[str, Inbox[SchemeMessage]]) -> Sent | None:
        """Make the exchange that is due; return what to send."""
        ahead_s = self._left_s.popleft()
        return self._cooperation.exchange(newest_messages(inboxes, self._cooperation), ahead_s)
