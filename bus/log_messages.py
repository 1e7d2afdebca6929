"""Messages that exist for flight logs: what was asked and answered, what the launcher saw, and the recorder.

Messages about how to fly are in `bus.messages`.
"""

from typing import Annotated, ClassVar, Final

from msgspec import Meta

from bus.message import Count, Message, Name, Seconds, Text

MAX_REQUEST_BYTES: Final = 131072
"""Of the largest request, a trajectory."""
MAX_REPLY_BYTES: Final = 32768


class AnsweredRequest(Message, frozen=True, kw_only=True):
    """A request and what was answered, told by whoever answered it."""

    MAX_BYTES: ClassVar[int] = MAX_REQUEST_BYTES + MAX_REPLY_BYTES

    verb: Name
    request: Annotated[bytes, Meta(max_length=MAX_REQUEST_BYTES)]
    """The request as it arrived, MessagePack."""
    reply: Annotated[bytes, Meta(max_length=MAX_REPLY_BYTES)]
    """The reply as it was sent, MessagePack."""
    took_s: Seconds
    """Time from its arrival to the answer."""


class LauncherEvent(Message, frozen=True, kw_only=True):
    """Something that happened to the processes of a host, for people."""

    text: Text


class RecorderStatus(Message, frozen=True, kw_only=True):
    """State of the flight log."""

    state: Annotated[str, Meta(pattern="^(recording|stopped)$")]
    reason: Text = ""
    """Why it stopped."""
    file: Text = ""
    """File that is being written."""
    messages: Count = 0
    written_bytes: Count = 0
    """Of this recorder process, after compression."""
    lost: Count = 0
    """Messages that were sent and did not arrive, by the counters of their senders, and messages dropped
    because the disk was too slow."""
