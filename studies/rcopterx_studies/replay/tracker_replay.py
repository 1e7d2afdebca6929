"""Plays a raw recording of a Tracker's stream to its clients, byte by byte as it was received."""

import math
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_link import TrackerLink
from rcopterx_studies.replay.raw_recording import RecordedConnection


class ReplayProgress(NamedTuple):
    """Connection that is replayed, of how many; its played time and length."""

    connection: int
    connections: int
    played_s: float
    total_s: float


class TrackerReplay(TrackerServer):
    """A Tracker that repeats a recording: the k-th client that connects gets the k-th recorded connection.

    What clients send has no effect. `port` 0 selects a free one, see `address`; `speed` 2 is twice as fast as
    real time. Raises `ValueError` for an empty recording or a speed that is not positive, and `OSError` if
    the address cannot be listened on.
    """

    def __init__(
        self,
        recording: Sequence[RecordedConnection],
        host: str = "127.0.0.1",
        port: int = 801,
        *,
        speed: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if not 0.0 < speed < math.inf:
            raise ValueError(f"speed {speed}: allowed is more than 0")
        if not recording:
            raise ValueError("the recording holds no connection")
        self._recording = recording
        self._speed = speed
        self._time_s, self._begun_at_s = clock, clock()
        super().__init__(host, port, clock=clock)

    @property
    def progress(self) -> ReplayProgress:
        """How far it is."""
        number = len(self._recording)
        if not self.accepted:
            return ReplayProgress(0, number, 0.0, 0.0)
        current = (self.accepted - 1) % number
        total_s = _end_s(self._recording[current])
        played_s = min((self._time_s() - self._begun_at_s) * self._speed, total_s)
        return ReplayProgress(current + 1, number, played_s, total_s)

    @property
    def finished(self) -> bool:
        """Whether the last recorded connection has been begun and no client is connected any more."""
        return self.accepted >= len(self._recording) and self.clients == 0

    def greet(self, client: TrackerLink) -> None:
        """Send the next recorded connection at its times."""
        self._begun_at_s = now_s = self._time_s()
        connection = self._recording[self.accepted % len(self._recording)]
        for after_s, data in connection.chunks:
            client.queue(data, now_s + after_s / self._speed)
        client.queue(None, now_s + _end_s(connection) / self._speed)

    def answer(self, client: TrackerLink, data: bytes) -> None:
        """Ignore what a client sends."""


def _end_s(connection: RecordedConnection) -> float:
    """End of a connection; where the recording stopped first it ends with its last bytes."""
    last_s = connection.chunks[-1][0] if connection.chunks else 0.0
    return connection.ended_after_s or last_s
