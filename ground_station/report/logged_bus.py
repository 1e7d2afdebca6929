"""The messages of a recorded flight, for what reads those of the bus of a running fleet."""

from collections.abc import Iterable
from typing import Any, TypeVar

from rcopterx.bus.channels import Channel
from rcopterx.bus.message import Message
from rcopterx.bus.session import RawMessage
from rcopterx.bus.subscription import Inbox, Units

M = TypeVar("M", bound=Message)


class LoggedBus:
    """Messages in order of arrival, up to a time [s]; see `rcopterx.bus.subscription.Source`.

    Times count from `started_s` on the clock of the recording.
    """

    def __init__(self, records: Iterable[RawMessage], started_s: float) -> None:
        self._records, self._started_s = iter(records), started_s
        self._next = next(self._records, None)
        self._units: dict[str, list[Units[Any]]] = {}
        self._now_s = 0.0

    def clock(self) -> float:
        """Return the time up to which messages have arrived."""
        return self._now_s

    def subscribe(self, channel: Channel[M], unit: str) -> Inbox[M]:
        """Receive a channel of one unit."""
        inbox = self.subscribe_all(channel).inboxes[unit] = Inbox(channel, unit=unit)
        return inbox

    def subscribe_all(
        self,
        channel: Channel[M],
        depth: int = 1,
        *,
        waking: bool = True,  # noqa: ARG002 - no loop waits
    ) -> Units[M]:
        """Receive a channel of every unit."""
        units = Units(channel, depth)
        self._units.setdefault(channel.topic, []).append(units)
        return units

    def advance(self, now_s: float) -> bool:
        """Let messages arrive up to a time; return whether there are later ones."""
        self._now_s = now_s
        while self._next is not None and (arrived_s := self._next.arrived_s - self._started_s) <= now_s:
            for units in self._units.get(self._next.topic, ()):
                if (inbox := units.inbox(self._next.unit)) is not None:
                    inbox.store(self._next.payload, arrived_s)
            self._next = next(self._records, None)
        return self._next is not None
