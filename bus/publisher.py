"""Publishers that number their messages, so that receivers notice losses."""

from itertools import count
from struct import Struct
from typing import Final

import zenoh

_COUNTER: Final = Struct("<I")
"""Attachment of every message: its number on this key."""


class Publisher:
    """Publisher of one key."""

    def __init__(self, publisher: zenoh.Publisher) -> None:
        self._publisher = publisher
        self._numbers = count(1)

    def put(self, payload: bytes) -> None:
        """Send a payload; never blocks, drops on congestion."""
        self._publisher.put(payload, attachment=_COUNTER.pack(next(self._numbers) & 0xFFFFFFFF))


def number_of(attachment: zenoh.ZBytes | None) -> int:
    """Return the number of a message from its attachment; 0 without one."""
    if attachment is None or len(attachment) != _COUNTER.size:
        return 0
    return int(_COUNTER.unpack(attachment.to_bytes())[0])
