"""Publishers that count their messages and know whether anybody listens."""

from itertools import count
from struct import Struct
from typing import Any, Final

import zenoh

from rcopterx.bus.receiving import direct

_COUNTER: Final = Struct("<I")
"""Every message carries the count of its sender on this key as an attachment, so that losses are seen."""


class Publisher:
    """Publisher of one key.

    Parameters
    ----------
    publisher
        Declared by Zenoh.
    declared_s
        When that was [monotonic s].
    """

    def __init__(self, publisher: zenoh.Publisher, declared_s: float) -> None:
        self.declared_s = declared_s
        self._publisher = publisher
        self._numbers = count(1)
        self._listener: zenoh.MatchingListener[None] | None = None
        self._changed = True
        self._matched = False

    def put(self, payload: bytes) -> None:
        """Send a payload; never blocks, drops on congestion."""
        self._publisher.put(payload, attachment=_COUNTER.pack(next(self._numbers) & 0xFFFFFFFF))

    def matched(self) -> bool:
        """Whether anybody listens, as far as the router has told.

        A question to Zenoh touches much memory that is cold in flight, so it is repeated only when Zenoh has
        said that something has changed.
        """
        if self._changed:
            if self._listener is None:
                self._listener = self._publisher.declare_matching_listener(direct(self._note_change))
            # Ahead of the question: what changes meanwhile is asked for once more.
            self._changed = False
            # Zenoh's description calls it a truth value.
            status: Any = self._publisher.matching_status
            self._matched = bool(status.matching)
        return self._matched

    def _note_change(self, _: zenoh.MatchingStatus) -> None:
        self._changed = True


def number_of(attachment: zenoh.ZBytes | None) -> int:
    """Count that came with a message; 0 without one."""
    if attachment is None or len(attachment) != _COUNTER.size:
        return 0
    return int(_COUNTER.unpack(attachment.to_bytes())[0])
