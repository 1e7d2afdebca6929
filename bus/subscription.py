"""Subscribers that answer for themselves: newest message, its age, and whether the sender keeps its rate.

A direct callback stores the payload and wakes the loop; nothing is decoded on Zenoh's thread and nothing ever
queues up unread.
"""

import threading
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, Generic, TypeVar

import zenoh
from msgspec import Struct
from zenoh.handlers import Callback

from rcopterx.bus.channels import CHANNELS, Channel
from rcopterx.bus.codec import RejectedError, decode
from rcopterx.bus.message import Message

M = TypeVar("M", bound=Message)

RATE_WINDOW = 10
RATE_TOLERANCE = 0.7


class Received(Struct, Generic[M], frozen=True):
    """A valid message and the local monotonic time of its arrival."""

    message: M
    arrived_s: float


class Rejections:
    """Counts of refused messages, written by receive threads while others read them."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._lock = threading.Lock()

    def count(self, kind: str) -> None:
        """Count one more of a kind."""
        with self._lock:
            self._counts[kind] += 1

    def counts(self) -> Counter[str]:
        """Counts of this moment."""
        with self._lock:
            return Counter(self._counts)


class Inbox(Generic[M]):
    """Messages of one channel of one unit, newest first in importance; knows no bus.

    Parameters
    ----------
    channel
        Row of the channel table.
    depth
        How many undecoded payloads are kept; older ones are dropped and counted as `overrun`.
    unit
        Whose messages they are, where that is known.

    Attributes
    ----------
    unread
        Payloads that have not been read, and when they arrived; whoever polls many inboxes reads only where
        there are some.
    """

    def __init__(self, channel: Channel[M], depth: int = 1, unit: str = "") -> None:
        self.channel = channel
        self.unit = unit
        self.reason = ""
        self.unread: deque[tuple[bytes, float]] = deque(maxlen=depth)
        self._rejections = Rejections()
        self._overruns_at = depth if depth > 1 else None
        self._arrivals: deque[float] = deque(maxlen=RATE_WINDOW)
        self._newest: Received[M] | None = None

    def store(self, payload: bytes, arrived_s: float) -> None:
        """Keep a payload for the loop. Called on the receive thread."""
        unread = self.unread
        if len(unread) == self._overruns_at:
            self._rejections.count("overrun")
        unread.append((payload, arrived_s))
        self._arrivals.append(arrived_s)

    def drain(self, limit: int | None = None) -> list[Received[M]]:
        """Valid messages that arrived since the last call, oldest first, from at most `limit` payloads."""
        received: list[Received[M]] = []
        unread = self.unread
        for _ in range(len(unread) if limit is None else min(limit, len(unread))):
            try:
                payload, arrived_s = unread.popleft()
            except IndexError:
                break
            try:
                message = decode(payload, self.channel.message)
            except RejectedError as error:
                self.reject(error.kind, str(error))
                continue
            self._newest = Received(message, arrived_s)
            received.append(self._newest)
        return received

    def waiting_since_s(self) -> float | None:
        """Arrival of the oldest message that has not been read; None if all have been."""
        try:
            return self.unread[0][1] if self.unread else None
        except IndexError:
            return None

    def latest(self) -> Received[M] | None:
        """Newest valid message, None before the first."""
        if self.unread:
            self.drain()
        return self._newest

    def reject(self, kind: str, reason: str) -> None:
        """Count a message that is not acceptable, here or to whoever reads the inbox."""
        self._rejections.count(kind)
        self.reason = reason

    def close(self) -> None:
        """Receive no more; for one that nobody fills from a bus there is nothing to do."""

    @property
    def rejected(self) -> Counter[str]:
        """Refused messages so far, by kind."""
        return self._rejections.counts()

    def age_s(self, now_s: float) -> float | None:
        """Age of the newest valid message on the local monotonic clock."""
        newest = self.latest()
        return None if newest is None else max(0.0, now_s - newest.arrived_s)

    def alive(self, now_s: float) -> bool:
        """Whether the newest valid message is younger than the channel's `stale_after_s`."""
        age_s = self.age_s(now_s)
        return age_s is not None and age_s <= self.channel.stale_after_s

    def rate_hz(self) -> float:
        """Rate of arrival over the last few messages; 0 before there are two."""
        arrivals = tuple(self._arrivals)
        if len(arrivals) < 2 or arrivals[-1] <= arrivals[0]:
            return 0.0
        return (len(arrivals) - 1) / (arrivals[-1] - arrivals[0])

    def rate_ok(self, now_s: float, nominal_hz: float | None = None) -> bool:
        """Whether the sender is alive and keeps at least 70 % of the nominal rate."""
        nominal_hz = self.channel.rate_hz if nominal_hz is None else nominal_hz
        return self.alive(now_s) and self.rate_hz() >= RATE_TOLERANCE * nominal_hz


Deliver = Callable[[Inbox[Any], bytes, float], None]
"""Puts a payload and the time of its arrival [monotonic s] into an inbox, now or later."""


class Subscription(Inbox[M]):
    """An inbox filled from the bus.

    Parameters
    ----------
    session
        Open Zenoh session.
    channel
        Row of the channel table.
    full_key
        Key of the unit subscribed to.
    clock
        Monotonic clock [s].
    wake
        Called on the receive thread after each message.
    depth
        See `Inbox`.
    origin
        Whose messages count: also those of this session, or only those of others.
    deliver
        Called on the receive thread to put a payload into the inbox.
    """

    def __init__(
        self,
        session: zenoh.Session,
        channel: Channel[M],
        full_key: str,
        clock: Callable[[], float],
        wake: Callable[[], None],
        depth: int = 1,
        origin: zenoh.Locality = zenoh.Locality.ANY,
        deliver: Deliver = Inbox.store,
    ) -> None:
        super().__init__(channel, depth, full_key.split("/")[-2])
        self._deliver = deliver
        self._key = zenoh.KeyExpr(full_key)
        self._clock = clock
        self._wake = wake
        self._subscriber = session.declare_subscriber(
            full_key, Callback(self._on_sample, indirect=False), allowed_origin=origin
        )

    def _on_sample(self, sample: zenoh.Sample) -> None:
        # A put on a wildcard key reaches everyone; only messages for exactly this key count. Zenoh compares
        # them, because a string would have to be made for every message.
        if sample.key_expr != self._key:
            self.reject("key", f"sent to {sample.key_expr}, not to {self._key}")
            return
        self._deliver(self, sample.payload.to_bytes(), self._clock())
        self._wake()

    def close(self) -> None:
        """Stop receiving."""
        self._subscriber.undeclare()


class UnitSubscriptions(Generic[M]):
    """One channel of every unit of a fleet, an inbox each; for ground stations, recorders and gateways."""

    def __init__(
        self,
        session: zenoh.Session,
        channel: Channel[M],
        pattern: str,
        clock: Callable[[], float],
        wake: Callable[[], None],
        depth: int = 1,
        deliver: Deliver = Inbox.store,
    ) -> None:
        self._deliver = deliver
        self.inboxes: dict[str, Inbox[M]] = {}
        self._rejections = Rejections()
        self._channel = channel
        self._depth = depth
        self._clock = clock
        self._wake = wake
        self._unit_at = pattern.split("/").index("*")
        # The Tracker tells its status, too, but another one than vehicles do.
        self._others = {row.unit for row in CHANNELS if row.topic == channel.topic} - {channel.unit}
        self._subscriber = session.declare_subscriber(pattern, Callback(self._on_sample, indirect=False))

    def _on_sample(self, sample: zenoh.Sample) -> None:
        full_key = str(sample.key_expr)
        if "*" in full_key:
            self._rejections.count("key")
            return
        unit = full_key.split("/")[self._unit_at]
        if unit in self._others:
            return
        inbox = self.inboxes.get(unit)
        if inbox is None:
            inbox = self.inboxes[unit] = Inbox(self._channel, self._depth, unit)
        self._deliver(inbox, sample.payload.to_bytes(), self._clock())
        self._wake()

    @property
    def rejected(self) -> Counter[str]:
        """What was put on a wildcard key and so belongs to no unit."""
        return self._rejections.counts()

    def close(self) -> None:
        """Stop receiving."""
        self._subscriber.undeclare()
