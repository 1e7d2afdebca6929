"""Publishers, and what they attach to messages: a number on the key, in lockstep also sender and time."""

from collections.abc import Callable
from functools import partial
from itertools import count
from struct import Struct
from typing import TYPE_CHECKING, Any, Final

import zenoh

from rcopterx.bus.channels import Channel

if TYPE_CHECKING:
    from rcopterx.bus.lockstep.participant import Participant

COUNTER: Final = Struct("<I")
"""Attachment of every message: its number on this key."""
STAMP: Final = Struct("<IIId")  # number on this key, counter, index of the sender, time of sending [s]


def number_of(attachment: bytes) -> int:
    """Return the number of a message from its attachment; 0 without one."""
    return int(COUNTER.unpack_from(attachment)[0]) if len(attachment) in (COUNTER.size, STAMP.size) else 0


def attached(attachment: zenoh.ZBytes | None) -> bytes:
    """Return the bytes of an attachment, none without one."""
    return b"" if attachment is None else attachment.to_bytes()


def sent_at(attachment: bytes) -> float | None:
    """Return when a message was sent in lockstep [s]; None for others."""
    return STAMP.unpack(attachment)[3] if len(attachment) == STAMP.size else None


def publisher_of(
    session: zenoh.Session, participant: "Participant | None", channel: Channel[Any], key: str
) -> Callable[[bytes], None]:
    """Return what sends a payload on a key: never blocks and drops on congestion, unless in lockstep."""
    encoding, priority = channel.encoding, getattr(zenoh.Priority, channel.priority.upper())
    if participant is None:
        drop, numbers = zenoh.CongestionControl.DROP, count(1)
        declared = session.declare_publisher(
            key, encoding=encoding, congestion_control=drop, priority=priority, express=False
        )
        return lambda payload: declared.put(payload, attachment=COUNTER.pack(next(numbers) & 0xFFFFFFFF))
    # Nothing may be lost; a declared publisher discards messages until it has found a subscriber.
    block = zenoh.CongestionControl.BLOCK
    put = partial(session.put, key, encoding=encoding, congestion_control=block, priority=priority)
    return lambda payload: put(payload=payload, attachment=participant.stamp(key))
