"""Attachments of messages: their number on the key, and in lockstep who sent them at which time."""

from struct import Struct
from typing import Final

from zenoh import ZBytes

COUNTER: Final = Struct("<I")
"""Attachment of every message: its number on this key."""
STAMP: Final = Struct("<IIId")  # number on this key, counter, index of the sender, time of sending [s]


def number_of(attachment: bytes) -> int:
    """Return the number of a message from its attachment; 0 without one."""
    return int(COUNTER.unpack_from(attachment)[0]) if len(attachment) in (COUNTER.size, STAMP.size) else 0


def attached(attachment: ZBytes | None) -> bytes:
    """Return the bytes of an attachment, none without one."""
    return b"" if attachment is None else attachment.to_bytes()


def sent_at(attachment: bytes) -> float | None:
    """Return when a message was sent in lockstep [s]; None for others."""
    return STAMP.unpack(attachment)[3] if len(attachment) == STAMP.size else None
