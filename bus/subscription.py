"""Inboxes of newest messages with their ages, filled by Zenoh's thread, decoded by the loop."""

import threading
from collections import Counter, deque
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import zenoh
from msgspec import Struct
from zenoh.handlers import Callback

from rcopterx.bus.channels import CHANNELS, Channel
from rcopterx.bus.codec import RejectedError, decode
from rcopterx.bus.message import Message

if TYPE_CHECKING:
    from rcopterx.bus.lockstep.participant import LockstepInbox

M = TypeVar("M", bound=Message)


class Received(Struct, Generic[M], frozen=True):
    """A valid message and the local monotonic time of its arrival."""

    message: M
    arrived_s: float


class Inbox(Generic[M]):
    """Messages of one channel of one unit; independent of the bus.

    It keeps `depth` undecoded payloads with the times of their arrival in `unread`; older ones are dropped
    and counted as `overrun`.
    """

    def __init__(self, channel: Channel[M], depth: int = 1, unit: str = "") -> None:
        self.channel = channel
        self.unit = unit
        self.key = f"{unit}/{channel.topic}"  # as in `AgentSteps.keys`
        self.unread: deque[tuple[bytes, float]] = deque(maxlen=depth)
        self._rejected, self._counting = Counter[str](), threading.Lock()
        self._overruns_at = depth if depth > 1 else None
        self._newest: Received[M] | None = None

    def store(self, payload: bytes, arrived_s: float) -> None:
        """Keep a payload for the loop. Called on the receive thread."""
        unread = self.unread
        if len(unread) == self._overruns_at:
            self.reject("overrun")
        unread.append((payload, arrived_s))

    def drain(self, limit: int | None = None) -> list[Received[M]]:
        """Return the valid messages since the last call, oldest first, from at most `limit` payloads."""
        received: list[Received[M]] = []
        unread = self.unread
        if not unread:
            return received
        for _ in range(len(unread) if limit is None else min(limit, len(unread))):
            try:
                payload, arrived_s = unread.popleft()
            except IndexError:
                break
            try:
                message = decode(payload, self.channel.message)
            except RejectedError as error:
                self.reject(error.kind)
                continue
            self._newest = Received(message, arrived_s)
            received.append(self._newest)
        return received

    def waiting_since_s(self) -> float | None:
        """Return the arrival of the oldest unread message, None without one."""
        try:
            return self.unread[0][1] if self.unread else None
        except IndexError:
            return None

    def latest(self) -> Received[M] | None:
        """Return the newest valid message, None before the first."""
        if self.unread:
            self.drain()
        return self._newest

    def reject(self, kind: str) -> None:
        """Count a message that is not acceptable, here or to the reader of the inbox."""
        with self._counting:
            self._rejected[kind] += 1

    def close(self) -> None:
        """Stop receiving; nothing to do without a bus."""

    @property
    def rejected(self) -> Counter[str]:
        """Rejected messages so far, by kind."""
        with self._counting:
            return self._rejected.copy()

    def age_s(self, now_s: float) -> float | None:
        """Return the age of the newest valid message on the local monotonic clock."""
        newest = self.latest()
        return None if newest is None else max(0.0, now_s - newest.arrived_s)

    def alive(self, now_s: float) -> bool:
        """Return whether the newest valid message is younger than the channel's `stale_after_s`."""
        age_s = self.age_s(now_s)
        return age_s is not None and age_s <= self.channel.stale_after_s


class Units(Generic[M]):
    """Inboxes of one channel, by the units that have sent something; independent of the bus."""

    def __init__(self, channel: Channel[M], depth: int = 1) -> None:
        self.inboxes: dict[str, Inbox[M]] = {}
        self._channel = channel
        self._depth = depth
        # Other units use the same topic for another type, as the Tracker does for its status.
        self._others = {row.unit for row in CHANNELS if row.topic == channel.topic} - {channel.unit}

    def inbox(self, unit: str) -> Inbox[M] | None:
        """Return the inbox of a unit; None for one that uses the topic for another type."""
        inbox = self.inboxes.get(unit)
        if inbox is None and unit not in self._others:
            inbox = self.inboxes[unit] = Inbox(self._channel, self._depth, unit)
        return inbox


class Source(Protocol):
    """Where messages come from: the bus (`Session`), or a recorded flight."""

    @property
    def clock(self) -> Callable[[], float]:
        """Clock [s] of the times of arrival."""

    def subscribe(self, channel: Channel[M], unit: str) -> Inbox[M]:
        """Receive a channel of one unit."""

    def subscribe_all(self, channel: Channel[M], depth: int = 1, *, waking: bool = True) -> Units[M]:
        """Receive a channel of every unit; messages can wake the loop of the process."""


Waking = bool | Callable[[], bool]  # whether messages wake the loop, or a function that decides it
Deliver = Callable[[Inbox[Any], bytes, float], None]
"""Puts a payload and the time of its arrival [monotonic s] into an inbox, now or later."""
OnArrival = Callable[[Inbox[Any], bytes], None]  # called on the receive thread with a payload and inbox


def callback_of(on_arrival: Callable[[Any], None], held: "LockstepInbox | None") -> "Callback[Any]":
    """Return what Zenoh calls with a sample or a query; in lockstep it waits for its turn."""
    return Callback(on_arrival if held is None else partial(held.hold, on_arrival), indirect=False)


class Subscription(Inbox[M]):
    """An inbox filled from the bus; `origin` selects whether the own session's messages are received."""

    def __init__(
        self,
        session: zenoh.Session,
        channel: Channel[M],
        full_key: str,
        on_arrival: OnArrival,
        depth: int = 1,
        origin: zenoh.Locality = zenoh.Locality.ANY,
        held: "LockstepInbox | None" = None,
    ) -> None:
        super().__init__(channel, depth, full_key.split("/")[-2])
        self._on_arrival = on_arrival
        self._held = held
        self._key = zenoh.KeyExpr(full_key)
        self._subscriber = session.declare_subscriber(
            full_key, callback_of(self._on_sample, held), allowed_origin=origin
        )

    def _on_sample(self, sample: zenoh.Sample) -> None:
        # A message on a wildcard key arrives, too; only messages on exactly this key count.
        if sample.key_expr != self._key:
            self.reject("key")
            return
        self._on_arrival(self, sample.payload.to_bytes())

    def close(self) -> None:
        """Stop receiving."""
        if self._held is not None:
            self._held.end()
        self._subscriber.undeclare()


class UnitSubscriptions(Units[M]):
    """One channel of every unit, with an inbox each; those that are not in `units`, if any, are ignored."""

    def __init__(
        self,
        session: zenoh.Session,
        channel: Channel[M],
        pattern: str,
        on_arrival: OnArrival,
        depth: int = 1,
        units: frozenset[str] = frozenset(),
        held: "LockstepInbox | None" = None,
    ) -> None:
        super().__init__(channel, depth)
        self._on_arrival = on_arrival
        self._units = units
        self._unit_at = pattern.split("/").index("*")
        self._held = held
        self._subscriber = session.declare_subscriber(pattern, callback_of(self._on_sample, held))

    def _on_sample(self, sample: zenoh.Sample) -> None:
        full_key = str(sample.key_expr)
        # A message on a wildcard key belongs to no unit.
        unit = None if "*" in full_key else full_key.split("/")[self._unit_at]
        if unit is None or (self._units and unit not in self._units):
            return
        if (inbox := self.inbox(unit)) is not None:
            self._on_arrival(inbox, sample.payload.to_bytes())

    def close(self) -> None:
        """Stop receiving."""
        if self._held is not None:
            self._held.end()
        self._subscriber.undeclare()
