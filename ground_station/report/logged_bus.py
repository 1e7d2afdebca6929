"""The messages of a recorded flight, for what reads those of the bus of a running fleet."""

from collections.abc import Iterable
from typing import Any, Generic, TypeVar

from rcopterx.bus.channels import Channel, others_of_topic
from rcopterx.bus.message import Message
from rcopterx.bus.session import RawMessage
from rcopterx.bus.subscription import Inbox

M = TypeVar("M", bound=Message)


class LoggedUnits(Generic[M]):
    """One channel of every unit; see `rcopterx.bus.subscription.Units`."""

    def __init__(self, channel: Channel[M], depth: int) -> None:
        self._channel, self._depth, self._others = channel, depth, others_of_topic(channel)
        self.inboxes: dict[str, Inbox[M]] = {}

    def inbox(self, unit: str) -> Inbox[M]:
        """Inbox of a unit."""
        if unit not in self.inboxes:
            self.inboxes[unit] = Inbox(self._channel, self._depth, unit)
        return self.inboxes[unit]

    def store(self, record: RawMessage, arrived_s: float) -> None:
        """Put a message into the inbox of its unit."""
        if record.unit not in self._others:
            self.inbox(record.unit).store(record.payload, arrived_s)


class LoggedBus:
    """Messages in order of arrival, up to a time [s]; see `rcopterx.bus.subscription.Source`.

    Times count from `started_s` on the clock of the recording.
    """

    def __init__(self, records: Iterable[RawMessage], started_s: float) -> None:
        self._records, self._started_s = iter(records), started_s
        self._next = next(self._records, None)
        self._units: dict[str, list[LoggedUnits[Any]]] = {}
        self._now_s = 0.0

    def clock(self) -> float:
        """Return the time up to which messages have arrived."""
        return self._now_s

    def subscribe(self, channel: Channel[M], unit: str) -> Inbox[M]:
        """Receive a channel of one unit."""
        return self.subscribe_all(channel).inbox(unit)

    def subscribe_all(
        self,
        channel: Channel[M],
        depth: int = 1,
        *,
        waking: bool = True,  # noqa: ARG002 - no loop waits
    ) -> LoggedUnits[M]:
        """Receive a channel of every unit."""
        units = LoggedUnits(channel, depth)
        self._units.setdefault(channel.topic, []).append(units)
        return units

    def advance(self, now_s: float) -> bool:
        """Let messages arrive up to a time; return whether there are later ones."""
        self._now_s = now_s
        while self._next is not None and (arrived_s := self._next.arrived_s - self._started_s) <= now_s:
            for units in self._units.get(self._next.topic, ()):
                units.store(self._next, arrived_s)
            self._next = next(self._records, None)
        return self._next is not None
