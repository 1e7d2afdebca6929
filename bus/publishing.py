"""Publishers."""

from collections.abc import Callable
from functools import partial
from itertools import count
from typing import TYPE_CHECKING, Any

import zenoh

from rcopterx.bus.attachments import COUNTER
from rcopterx.bus.channels import Channel

if TYPE_CHECKING:
    from rcopterx.bus.lockstep.participant import Participant


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
