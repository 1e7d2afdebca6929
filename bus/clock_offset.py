"""Offset between the clocks of two hosts, from messages that go to and fro between them."""

from collections import deque
from typing import Final, NamedTuple

SAMPLES: Final = 125
"""Of which the one with the shortest round trip counts: ten seconds of beats."""


class ClockOffset(NamedTuple):
    """What one exchange tells.

    Attributes
    ----------
    offset_s
        Clock of the other host minus that of this one; wrong by at most half the round trip.
    round_trip_s
        Time on the way, there and back.
    """

    offset_s: float
    round_trip_s: float


class ClockFilter:
    """The exchange with the shortest round trip of the newest ones counts, as in NTP (RFC 5905)."""

    def __init__(self) -> None:
        self._samples: deque[ClockOffset] = deque(maxlen=SAMPLES)

    def add(self, sent_s: float, received_s: float, answered_s: float, arrived_s: float) -> None:
        """Take an exchange into account.

        Parameters
        ----------
        sent_s, arrived_s
            When this host sent its message and got the answer, on its own clock.
        received_s, answered_s
            When the other host got the message and sent its answer, on its own clock.
        """
        offset_s = ((received_s - sent_s) + (answered_s - arrived_s)) / 2
        round_trip_s = (arrived_s - sent_s) - (answered_s - received_s)
        self._samples.append(ClockOffset(offset_s, max(0.0, round_trip_s)))

    def best(self) -> ClockOffset | None:
        """The most accurate of the newest exchanges, None before the first."""
        return min(self._samples, key=lambda sample: sample.round_trip_s, default=None)
