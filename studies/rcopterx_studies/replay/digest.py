"""Digest of a flight log: equal for flights whose motion, plans, commands and frames have the same bits."""

import hashlib
from collections.abc import Iterable
from typing import Final, NamedTuple

from rcopterx.bus.channels import ANSWERED, APPLIED, COMMAND, LABORATORY, PLAN, POSE
from rcopterx.flights.mcap_writing import LoggedMessage

DIGESTED: Final = (POSE, PLAN, COMMAND, APPLIED, LABORATORY)  # without process ids and times of a computer


class FlightDigest(NamedTuple):
    """Digest, and of how many messages."""

    digest: str
    messages: int


def digest_of(messages: Iterable[LoggedMessage]) -> FlightDigest:
    """Return the digest of those of `DIGESTED` until the last answered request."""
    topics = {channel.topic for channel in DIGESTED}
    kept, end_ns = [], 0
    for message in messages:
        topic = message.topic.rpartition("/")[2]
        if topic == ANSWERED.topic:
            end_ns = max(end_ns, message.time_ns)
        elif topic in topics:
            kept.append(message)
    found = hashlib.sha256()
    counted = 0
    for message in sorted(kept, key=lambda message: (message.topic, message.time_ns, message.number)):
        if message.time_ns <= end_ns or not end_ns:
            found.update(f"{message.topic} {message.number} ".encode() + message.payload)
            counted += 1
    return FlightDigest(found.hexdigest()[:16], counted)
