"""Offset between the clocks of two hosts, estimated from messages in both directions."""

from collections import deque
from typing import Final, NamedTuple

SAMPLES: Final = 125
"""Newest exchanges that are kept: ten seconds of beats."""


class ClockOffset(NamedTuple):
    """Result of one exchange.

    `offset_s` is the other host's clock minus this one's, wrong by at most half of `round_trip_s`.
    """

    offset_s: float
    round_trip_s: float


class ClockFilter:
    """Selects the exchange with the shortest round trip of the newest ones, as in NTP (RFC 5905)."""

    def __init__(self) -> None:
        self._samples: deque[ClockOffset] = deque(maxlen=SAMPLES)

    def add(self, sent_s: float, received_s: float, answered_s: float, arrived_s: float) -> None:
        """Add an exchange: sent and arrived by this host's clock, received and answered by the other's."""
        offset_s = ((received_s - sent_s) + (answered_s - arrived_s)) / 2
        round_trip_s = (arrived_s - sent_s) - (answered_s - received_s)
        self._samples.append(ClockOffset(offset_s, max(0.0, round_trip_s)))

    def best(self) -> ClockOffset | None:
        """Return the most accurate of the newest exchanges, None before the first."""
        return min(self._samples, key=lambda sample: sample.round_trip_s, default=None)
