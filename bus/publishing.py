"""Publishers, and the attachments of messages."""

from collections.abc import Callable
from functools import partial
from itertools import count
from struct import Struct
from typing import Any, Final

import zenoh

from rcopterx.bus.channels import Channel
from rcopterx.bus.turns import STAMP, Turns

_COUNTER: Final = Struct("<I")
"""Attachment of every message: its number on this key."""


def number_of(attachment: bytes) -> int:
    """Return the number of a message from its attachment; 0 without one."""
    return int(_COUNTER.unpack_from(attachment)[0]) if len(attachment) in (_COUNTER.size, STAMP.size) else 0


def publisher_of(
    session: zenoh.Session, turns: Turns | None, channel: Channel[Any], key: str
) -> Callable[[bytes], None]:
    """Return what sends a payload on a key: never blocks and drops on congestion, unless in lockstep."""
    encoding, priority = channel.encoding, getattr(zenoh.Priority, channel.priority.upper())
    if turns is None:
        drop, numbers = zenoh.CongestionControl.DROP, count(1)
        declared = session.declare_publisher(
            key, encoding=encoding, congestion_control=drop, priority=priority, express=False
        )
        return lambda payload: declared.put(payload, attachment=_COUNTER.pack(next(numbers) & 0xFFFFFFFF))
    # Nothing may be lost; a declared publisher discards messages until it has found a subscriber.
    block = zenoh.CongestionControl.BLOCK
    put = partial(session.put, key, encoding=encoding, congestion_control=block, priority=priority)
    return lambda payload: put(payload=payload, attachment=turns.stamp(key))
