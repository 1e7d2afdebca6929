"""Messages that exist for flight logs: what was asked and answered, what the launcher saw, and the recorder.

Messages about how to fly are in `rcopterx.bus.messages`.
"""

import math
import struct
import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Final

from msgspec import Meta, Struct

from rcopterx.bus.message import Count, InvalidMessageError, Message, Name, Seconds, Text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MAX_REQUEST_BYTES: Final = 131072
"""Of the largest request, a trajectory."""
MAX_REPLY_BYTES: Final = 32768
_COUNTS: Final = struct.Struct("<16i")
_EXACT: Final = struct.Struct("<16d")
_MOST: Final = 2.0**31 - 1.0


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


class RoundedEstimate(Struct, frozen=True):
    """Motion (8), actuators (4) and disturbance (4) as estimated at a frame, to find causes by."""

    checksum: Count
    """CRC-32 of the 64-bit little-endian floats: tells whether a replay differs."""
    data: Annotated[bytes, Meta(min_length=64, max_length=64)]
    """Where and how much: 32-bit little-endian integers in units of 2^-16, the lowest bytes of all first."""

    UNIT: ClassVar[float] = 2.0**-16

    @classmethod
    def of(cls, values: Sequence[float]) -> "RoundedEstimate":
        """Round and pack 16 values."""
        # Plain numbers: arrays of sixteen take longer than the arithmetic on them.
        told, unit, largest = values, cls.UNIT, _MOST * cls.UNIT
        # What is not a number spreads to the sum, whereas least and largest pass over it.
        if min(values) < -largest or max(values) > largest or not math.isfinite(sum(values)):
            told = [max(-largest, min(value, largest)) for value in values]
        octets = _COUNTS.pack(*[round(value / unit) for value in told])
        planes = b"".join([octets[place::4] for place in range(4)])
        return cls(zlib.crc32(_EXACT.pack(*values)), planes)

    def to_numpy(self) -> "NDArray[np.float64]":
        """The rounded values, shape (16,)."""
        import numpy as np

        planes = np.frombuffer(self.data, dtype=np.uint8).reshape(4, -1)
        values: NDArray[np.float64] = np.ascontiguousarray(planes.T).view("<i4").ravel() * self.UNIT
        return values


class AgentSteps(Message, frozen=True, kw_only=True):
    """What an agent took in, step by step: with the messages themselves, all that a replay needs.

    A step begins with whatever has arrived, at one time; nothing else enters into what the agent does in it,
    but that calls may be given up for time.
    """

    MAX_BYTES: ClassVar[int] = 131072

    life: Count
    """Identifies the process."""
    began_s: float
    """Monotonic clock of the host when the agent was made."""
    number: Count
    """Counts up from 0 in one life."""
    times_s: tuple[float, ...]
    """Beginning of each step [monotonic s]."""
    counts: tuple[Count, ...]
    """How many inputs each step took in."""
    keys: tuple[Text, ...]
    """Of each input: unit and topic (`h1/plan`), a request (`request/land`), or a word of its own."""
    subscriptions: tuple[Count, ...]
    """Of each input: which subscription of the agent received it, in the order in which they were made."""
    checksums: tuple[Count, ...]
    """Of each input: CRC-32 of its bytes, by which it is found in the flight log."""
    arrivals_s: tuple[float, ...]
    """Of each input: when it arrived [monotonic s]."""
    overtime: tuple[tuple[Count, Count, Count], ...] = ()
    """What was given up because it took too long: the step, the call of a controller or an estimator in it,
    and the question of the solver in that call from which on its time was over; 0 for the whole call."""
    replies: tuple[Annotated[bytes, Meta(max_length=MAX_REPLY_BYTES * 3)], ...] = ()
    """Replies to what the agent itself asked for when it was made."""
    estimate: RoundedEstimate | None = None
    """Of the control period that ends these steps, if there is one."""

    def check(self) -> None:
        """See `Message.check`."""
        if len(self.counts) != len(self.times_s):
            raise InvalidMessageError(f"counts: {len(self.counts)} for {len(self.times_s)} steps")
        inputs = (self.keys, self.subscriptions, self.checksums, self.arrivals_s)
        if any(len(column) != sum(self.counts) for column in inputs):
            raise InvalidMessageError("keys: not as many inputs as the steps took in")
        if any(step >= len(self.times_s) for step, *_ in self.overtime):
            raise InvalidMessageError(f"overtime: of other steps than these {len(self.times_s)}")
