"""Publishers, and the attachments of messages."""

from collections.abc import Callable
from functools import partial
from itertools import count
from struct import Struct
from typing import Any, Final

import zenoh

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.turns import STAMP, Turns

_PRIORITIES = {
    channels.REAL_TIME: zenoh.Priority.REAL_TIME,
    channels.INTERACTIVE_HIGH: zenoh.Priority.INTERACTIVE_HIGH,
    channels.DATA_HIGH: zenoh.Priority.DATA_HIGH,
    channels.DATA_LOW: zenoh.Priority.DATA_LOW,
}


_COUNTER: Final = Struct("<I")
"""Attachment of every message: its number on this key."""


class Publisher:
    """Publisher of one key, by `put` of Zenoh; `stamp` returns the attachment of the next message."""

    def __init__(self, put: Callable[..., None], stamp: Callable[[], bytes]) -> None:
        self._put, self._stamp = put, stamp

    def put(self, payload: bytes) -> None:
        """Send a payload; never blocks, drops on congestion."""
        self._put(payload=payload, attachment=self._stamp())


def number_of(attachment: bytes) -> int:
    """Return the number of a message from its attachment; 0 without one."""
    return int(_COUNTER.unpack_from(attachment)[0]) if len(attachment) in (_COUNTER.size, STAMP.size) else 0


def declared_publisher(
    session: zenoh.Session, turns: Turns | None, channel: Channel[Any], key: str
) -> Publisher:
    """Return a publisher of a channel on a key, with the stamps of `turns` in lockstep."""
    encoding, priority = channel.encoding, _PRIORITIES[channel.priority]
    if turns is None:
        drop, numbers = zenoh.CongestionControl.DROP, count(1)
        declared = session.declare_publisher(
            key, encoding=encoding, congestion_control=drop, priority=priority, express=False
        )
        return Publisher(declared.put, lambda: _COUNTER.pack(next(numbers) & 0xFFFFFFFF))
    # Nothing may be lost; a declared publisher discards messages until it has found a subscriber.
    block = zenoh.CongestionControl.BLOCK
    put = partial(session.put, key, encoding=encoding, congestion_control=block, priority=priority)
    return Publisher(put, partial(turns.stamp, key))
