"""A bus in memory: what a session uses of Zenoh, for all sessions of one process."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from zenoh import KeyExpr, ZBytes

from rcopterx.bus.attachments import STAMP
from rcopterx.bus.session import BusAddress

LOST_S: Final = 0.0
"""Time of sending before any subscription: such a message counts as arrived, and has no effect."""

Travel = Callable[[float], tuple[float, ...]]
"""Times of arrival of a message by that of sending [s]: none if it is lost, several if doubled."""


class MemorySample(NamedTuple):
    """A message, as `zenoh.Sample`."""

    key_expr: KeyExpr
    payload: ZBytes
    attachment: ZBytes


class MemoryReply(NamedTuple):
    """An answer, as `zenoh.Reply`."""

    ok: MemorySample | None
    err: MemorySample | None = None


class MemoryQuery(AbstractContextManager["MemoryQuery"]):
    """A request, as `zenoh.Query`."""

    def __init__(self, sample: MemorySample, answer: Callable[[MemoryReply], object]) -> None:
        self.key_expr, self.payload, self.attachment = sample
        self._answer = answer

    def __exit__(self, *_: object) -> None:
        pass

    def reply(self, key: KeyExpr, payload: bytes, attachment: bytes | None = None) -> None:
        """Answer."""
        self._answer(MemoryReply(MemorySample(key, ZBytes(payload), ZBytes(attachment or b""))))

    def reply_err(self, payload: bytes) -> None:
        """Refuse."""
        self._answer(MemoryReply(None, MemorySample(self.key_expr, ZBytes(payload), ZBytes(b""))))


@dataclass(frozen=True, eq=False)
class _Receiver:
    """A subscriber or queryable of a session; the bus keeps what it calls, until it is forgotten."""

    session: "MemorySession"
    key: KeyExpr

    def undeclare(self) -> None:
        """End it."""
        self.session.forget(self)


class MemoryBus:
    """Carries messages between the sessions of one process, at once unless `travel` says otherwise."""

    def __init__(self) -> None:
        self.travel: Travel | None = None
        self.subscribers: dict[_Receiver, Callable[[Any], object]] = {}
        self.queryables: dict[_Receiver, Callable[[Any], object]] = {}
        self._keys: dict[str, KeyExpr] = {}
        self._matching: dict[str, list[_Receiver]] = {}

    def open(self, address: BusAddress, _timeout_s: float = 0.0) -> "MemorySession":
        """Open a session; takes the place of `rcopterx.bus.session.opened`."""
        return MemorySession(self, takes_turns=bool(address.process))

    def key(self, key: str) -> KeyExpr:
        """Return a key as Zenoh passes it to receivers."""
        if key not in self._keys:
            self._keys[key] = KeyExpr(key)
        return self._keys[key]

    def changed(self) -> None:
        """Note that subscribers have changed."""
        self._matching.clear()

    def deliver(self, key: str, payload: bytes, attachment: bytes) -> None:
        """Pass a message to its subscribers; sessions that take no turns get it at once."""
        key_expr = self.key(key)
        if key not in self._matching:
            self._matching[key] = [each for each in self.subscribers if each.key.intersects(key_expr)]
        if len(attachment) != STAMP.size or self.travel is None:
            arrivals = [attachment]
        else:
            number, counter, sender, sent_s = STAMP.unpack(attachment)
            times_s = self.travel(sent_s) or (LOST_S,)
            arrivals = [STAMP.pack(number, counter, sender, time_s) for time_s in times_s]
        for subscriber in self._matching[key]:
            for stamped in arrivals if subscriber.session.takes_turns else [attachment]:
                self.subscribers[subscriber](MemorySample(key_expr, ZBytes(payload), ZBytes(stamped)))


class MemorySession:
    """A session of a bus in memory, as `zenoh.Session`."""

    def __init__(self, bus: MemoryBus, *, takes_turns: bool) -> None:
        self._bus, self.takes_turns = bus, takes_turns

    def put(self, key: str, payload: bytes, attachment: bytes = b"", **_: object) -> None:
        """Send a message."""
        self._bus.deliver(key, payload, attachment)

    def declare_subscriber(self, key: str, handler: Callable[[Any], object], **_: object) -> _Receiver:
        """Receive what is sent on a key."""
        receiver = _Receiver(self, self._bus.key(key))
        self._bus.subscribers[receiver] = handler
        self._bus.changed()
        return receiver

    def declare_queryable(self, key: str, handler: Callable[[Any], object], **_: object) -> _Receiver:
        """Answer requests on a key."""
        receiver = _Receiver(self, self._bus.key(key))
        self._bus.queryables[receiver] = handler
        return receiver

    def get(
        self,
        key: str,
        handler: Callable[[Any], object] | None = None,
        payload: bytes = b"",
        attachment: bytes = b"",
        **_: object,
    ) -> list[MemoryReply]:
        """Send a request; return the replies that are given at once, unless a handler gets them."""
        replies: list[MemoryReply] = []
        key_expr = self._bus.key(key)
        sample = MemorySample(key_expr, ZBytes(payload), ZBytes(attachment))
        for queryable in [each for each in self._bus.queryables if each.key.intersects(key_expr)]:
            self._bus.queryables[queryable](MemoryQuery(sample, handler or replies.append))
        return replies

    def forget(self, receiver: _Receiver) -> None:
        """End a subscriber."""
        self._bus.subscribers.pop(receiver, None)
        self._bus.changed()

    def close(self) -> None:
        """Leave the bus, as the end of a process does."""
        bus = self._bus
        for receivers in (bus.subscribers, bus.queryables):
            for receiver in [each for each in receivers if each.session is self]:
                del receivers[receiver]
        bus.changed()
