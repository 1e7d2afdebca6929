"""Records messages of the bus in memory; they are decoded when they are read."""

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from itertools import chain
from operator import attrgetter, itemgetter
from typing import Any, TypeVar

from rcopterx.bus.channels import CHANNELS, Channel
from rcopterx.bus.codec import RejectedError, decode
from rcopterx.bus.message import Message
from rcopterx.bus.session import RawMessage, Session

M = TypeVar("M", bound=Message)


class Recording:
    """Messages of a flight by channel and unit."""

    def __init__(self, records: Iterable[RawMessage]) -> None:
        self._records: dict[tuple[str, str], list[RawMessage]] = {}
        for record in records:
            self._records.setdefault((record.topic, record.unit), []).append(record)
        self._rejected: dict[tuple[str, str], Counter[str]] = {}

    @property
    def rejected(self) -> Counter[str]:
        """Rejected messages of the channels and units that were read, by topic and kind."""
        return sum(self._rejected.values(), Counter[str]())

    def units(self, channel: Channel[Any]) -> list[str]:
        """Units with messages on a channel."""
        # The Tracker and vehicles have statuses of different types on the same topic.
        others = {row.unit for row in CHANNELS if row.topic == channel.topic and row.unit != channel.unit}
        return sorted(unit for topic, unit in self._records if topic == channel.topic and unit not in others)

    def messages(self, channel: Channel[M], unit: str) -> list[tuple[M, float]]:
        """Valid messages of a channel and unit with their arrival times, in order."""
        found, rejected = [], Counter[str]()
        for record in self._records.get((channel.topic, unit), ()):
            try:
                found.append((decode(record.payload, channel.message), record.arrived_s))
            except RejectedError as error:
                rejected[f"{channel.topic}.{error.kind}"] += 1
        self._rejected[channel.topic, unit] = rejected
        return found

    def in_order(self, channels: Iterable[Channel[M]]) -> list[tuple[float, str, M]]:
        """Arrival times, units and valid messages of all units on some channels, in order of arrival."""
        found = [
            (arrived_s, unit, message)
            for channel in channels
            for unit in self.units(channel)
            for message, arrived_s in self.messages(channel, unit)
        ]
        return sorted(found, key=itemgetter(0))

    def records(self) -> list[RawMessage]:
        """All messages in order of arrival."""
        return sorted(chain.from_iterable(self._records.values()), key=attrgetter("arrived_s"))


class FlightSampler:
    """Records messages between `start` and `stop`: `only` some channels, `kept` newest messages."""

    def __init__(
        self, session: Session, kept: int | None = None, only: Sequence[Channel[Any]] | None = None
    ) -> None:
        self._records: deque[RawMessage] = deque(maxlen=kept)
        self._topics = {channel.topic for channel in CHANNELS if channel.recorded}
        self._active = False
        for topic in ("*",) if only is None else tuple(channel.topic for channel in only):
            session.tap(self._store, topic)

    def _store(self, message: RawMessage) -> None:
        if self._active and message.topic in self._topics:
            self._records.append(message)

    def start(self) -> None:
        """Begin a new recording."""
        self._records.clear()
        self._active = True

    def stop(self) -> Recording:
        """End the recording and return it."""
        self._active = False
        return Recording(self._records)
