"""Messages of schemes on the bus."""

from collections.abc import Mapping

import numpy as np

from rcopterx.agents.cooperation import Cooperation, Sent, Unpacked
from rcopterx.bus.scheme_message import SchemeMessage
from rcopterx.bus.subscription import Inbox
from rcopterx.vehicles.state import three


def scheme_message(sent: Sent, source: str, epoch: int, frame: int) -> SchemeMessage:
    """Return what a vehicle publishes."""
    return SchemeMessage(
        epoch=epoch,
        frame=frame,
        source=source,
        scheme=sent.scheme,
        offsets_m={name: three(offset) for name, offset in sent.offsets_m.items()},
        payload=sent.payload,
    )


def unpacked(message: SchemeMessage, cooperation: Cooperation, age_s: float) -> Unpacked | None:
    """Unpack a message; None if it is of another scheme, or rejected and counted."""
    offset = message.offsets_m.get(cooperation.vehicle)
    offset_m = None if offset is None else np.array(offset)
    return cooperation.unpack(message.scheme, message.payload, offset_m, age_s)


def newest_messages(
    inboxes: Mapping[str, Inbox[SchemeMessage]], cooperation: Cooperation
) -> dict[str, Unpacked]:
    """Newest usable messages of other vehicles, of the present epoch."""
    if cooperation.scheme is None:
        return {}
    clock, found = cooperation.clock, {}
    for name, inbox in tuple(inboxes.items()):
        newest = None if name == cooperation.vehicle else inbox.latest()
        if newest is not None and newest.message.epoch == clock.epoch:
            age_s = (clock.current_frame - newest.message.frame) * clock.period_s
            message = unpacked(newest.message, cooperation, max(age_s, 0.0))
            if message is not None:
                found[name] = message
    return found
