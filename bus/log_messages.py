"""Messages for flight logs: requests, events of launchers, steps of agents, calls of arbiters, recorder."""

import struct
import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Final

from msgspec import Meta, Struct

from rcopterx.bus import message
from rcopterx.bus.message import Clock, Count, InvalidMessageError, Message, Name, Seconds, Text

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MAX_REQUEST_BYTES: Final = 131072
"""The largest request is a trajectory."""
MAX_REPLY_BYTES: Final = 32768
_COUNTS: Final = struct.Struct("<16i")
_EXACT: Final = struct.Struct("<16d")
_MOST: Final = 2.0**31 - 1.0


class AnsweredRequest(Message, frozen=True, kw_only=True):
    """A request with its answer, published by the process that answered."""

    MAX_BYTES: ClassVar[int] = MAX_REQUEST_BYTES + MAX_REPLY_BYTES

    verb: Name
    request: Annotated[bytes, Meta(max_length=MAX_REQUEST_BYTES)]
    """The request as it arrived, MessagePack."""
    reply: Annotated[bytes, Meta(max_length=MAX_REPLY_BYTES)]
    """The reply as it was sent, MessagePack."""
    took_s: Seconds
    """Time from its arrival to the answer."""


class LauncherEvent(Message, frozen=True, kw_only=True):
    """An event of the processes of a host, as text."""

    text: Text


class RecorderStatus(Message, frozen=True, kw_only=True):
    """State of the flight log."""

    state: Annotated[str, Meta(pattern="^(recording|stopped)$")]
    reason: Text = ""
    """Why it stopped; it resumes as soon as the disk permits."""
    file: Text = ""
    """File under construction."""
    messages: Count = 0
    written_bytes: Count = 0
    """Of this recorder process, after compression."""
    lost: Count = 0
    """Messages that did not arrive, by the counters of their senders, or were not written to the disk."""


class RoundedEstimate(Struct, frozen=True):
    """Motion (8), actuators (4) and disturbance (4) as estimated at a frame."""

    checksum: Count
    """CRC-32 of the 64-bit little-endian floats: shows whether a replay differs."""
    data: Annotated[bytes, Meta(min_length=64, max_length=64)]
    """32-bit little-endian integers in units of 2^-16, the lowest bytes of all first."""

    UNIT: ClassVar[float] = 2.0**-16

    @classmethod
    def of(cls, values: Sequence[float]) -> "RoundedEstimate":
        """Round and pack 16 values."""
        # In this order NaN becomes the lower limit.
        counts = [max(-_MOST, min(value / cls.UNIT, _MOST)) for value in values]
        octets = _COUNTS.pack(*map(round, counts))
        planes = b"".join(octets[place::4] for place in range(4))
        return cls(zlib.crc32(_EXACT.pack(*values)), planes)

    def to_numpy(self) -> "NDArray[np.float64]":
        """Return the rounded values, shape (16,)."""
        import numpy as np

        planes = np.frombuffer(self.data, dtype=np.uint8).reshape(4, -1)
        values: NDArray[np.float64] = np.ascontiguousarray(planes.T).view("<i4").ravel() * self.UNIT
        return values


class AgentSteps(Message, frozen=True, kw_only=True):
    """Inputs of an agent, step by step: with the messages themselves, all that a replay needs.

    A step begins with the inputs that have arrived, at one time. Nothing else influences what the agent does
    in it, except for calls that were given up for time.
    """

    MAX_BYTES: ClassVar[int] = 131072

    life: Count
    """Identifies the process."""
    began_s: Clock
    """Monotonic clock of the host at the start of the agent."""
    number: Count
    """Counts up from 0 in one life."""
    times_s: tuple[Clock, ...]
    """Beginning of each step [monotonic s]."""
    counts: tuple[Count, ...]
    """Number of inputs of each step."""
    keys: tuple[Text, ...]
    """Of each input: unit and topic (`h1/plan`), a request (`request/land`), or an event of the process."""
    subscriptions: tuple[Count, ...]
    """Of each input: number of the agent's subscription that received it."""
    checksums: tuple[Count, ...]
    """Of each input: CRC-32 of its bytes, by which it is found in the flight log."""
    arrivals_s: tuple[Clock, ...]
    """Of each input: time of its arrival [monotonic s]."""
    overtime: tuple[tuple[Count, Count, Count], ...] = ()
    """Calls given up for time: the step, the call of a controller or an estimator in it, and the solver call
    in that from which on its time was over; 0 for the whole call."""
    replies: tuple[Annotated[bytes, Meta(max_length=MAX_REPLY_BYTES * 3)], ...] = ()
    """Replies to the requests of the agent during its start."""
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


Single = bool | message.Whole | message.Finite | None
Argument = Single | Annotated[str, Meta(max_length=4096)] | tuple[Single | tuple[message.Finite, ...], ...]
ArbiterCall = tuple[Name, Name, Clock, tuple[Argument, ...]]


class ArbiterCalls(Message, frozen=True, kw_only=True):
    """Calls of the arbiters of a gateway: with poses and commands, all that a replay needs.

    One message for all vehicles of the gateway, under the name of the first one.
    """

    MAX_BYTES: ClassVar[int] = 65_000

    began_s: Clock
    """Monotonic clock of the host at the start of the gateway, by which its processes differ."""
    number: Count
    """Of the first call; counts up from 0 in one process."""
    calls: tuple[ArbiterCall, ...]
    """In order: what is called; the vehicle, for a `pose`, which all arbiters get, that of the pose; the
    time [monotonic s]; arguments, of a pose epoch and frame, of a `command` lease and sequence. `written` is
    a frame, `reason` that of the state in frames from now on."""
