"""Keeps what travels on the bus during a flight, undecoded until the flight is over."""

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from rcopterx.bus.channels import CHANNELS, Channel
from rcopterx.bus.codec import RejectedError, decode
from rcopterx.bus.message import Message
from rcopterx.bus.session import RawMessage, Session

M = TypeVar("M", bound=Message)


@dataclass(frozen=True, slots=True)
class Record:
    """One payload as it arrived."""

    unit: str
    topic: str
    payload: bytes
    arrived_s: float


class Recording:
    """Messages of a flight by channel and unit; decoding happens on reading."""

    def __init__(self, records: Iterable[Record]) -> None:
        self._records: dict[tuple[str, str], list[Record]] = {}
        for record in records:
            self._records.setdefault((record.topic, record.unit), []).append(record)
        self.rejected: Counter[str] = Counter()

    def units(self, channel: Channel[Any]) -> list[str]:
        """Units that sent something on a channel."""
        # The Tracker and the vehicles have a status each, of different types.
        others = {row.unit for row in CHANNELS if row.topic == channel.topic and row.unit != channel.unit}
        return sorted(unit for topic, unit in self._records if topic == channel.topic and unit not in others)

    def messages(self, channel: Channel[M], unit: str) -> list[tuple[M, float]]:
        """Valid messages of a channel and unit with their arrival times, in order."""
        found = []
        for record in self._records.get((channel.topic, unit), ()):
            try:
                found.append((decode(record.payload, channel.message), record.arrived_s))
            except RejectedError as error:
                self.rejected[f"{channel.topic}.{error.kind}"] += 1
        return found

    def __len__(self) -> int:
        return sum(map(len, self._records.values()))


class Recorder:
    """Records what is on the bus between `start` and `stop`.

    Parameters
    ----------
    session
        Open bus session.
    kept
        How many messages are kept, the newest ones; None keeps all.
    only
        Channels to subscribe to; None takes every recorded one.
    """

    def __init__(
        self, session: Session, kept: int | None = None, only: Sequence[Channel[Any]] | None = None
    ) -> None:
        self._records: deque[Record] = deque(maxlen=kept)
        self._topics = {channel.topic for channel in CHANNELS if channel.recorded}
        self._active = False
        for topic in ("*",) if only is None else tuple(channel.topic for channel in only):
            session.tap(self._store, topic)

    def _store(self, heard: RawMessage) -> None:
        if self._active and heard.topic in self._topics:
            self._records.append(Record(heard.unit, heard.topic, heard.payload, heard.arrived_s))

    def start(self) -> None:
        """Begin anew."""
        self._records.clear()
        self._active = True

    def stop(self) -> Recording:
        """End and hand the recording over."""
        self._active = False
        return Recording(self._records)
