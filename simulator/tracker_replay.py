"""Plays a raw recording of a Tracker's stream to its clients, byte by byte as it was received."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, Self

from rcopterx.simulator.tracker import TrackerServer
from rcopterx.vicon_gateway.recording import RecordedConnection


class ReplayProgress(NamedTuple):
    """Progress of a replay: the recorded connection that was begun last, from 1, of how many; its played time
    and its length; and the clients connected now.
    """

    connection: int
    connections: int
    played_s: float
    total_s: float
    clients: int


class TrackerReplay:
    """A Tracker that repeats a recording: the k-th client that connects gets the k-th recorded connection.

    `port` 0 selects a free one, see `address`; `speed` 2 is twice as fast as real time. Raises `ValueError`
    for an empty recording or a speed that is not positive, and `OSError` if the address cannot be listened
    on.
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
        self._connections = [_ending(connection) for connection in recording]
        self._speed = speed
        self._clock = clock
        self._begun = 0
        self._begun_at_s = clock()
        self._server = TrackerServer(
            host, port, clock=clock, replay=[_faster(connection, speed) for connection in self._connections]
        )

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the listening socket."""
        return self._server.address

    @property
    def progress(self) -> ReplayProgress:
        """How far it is."""
        clients, number = self._server.state.clients, len(self._connections)
        if not self._begun:
            return ReplayProgress(0, number, 0.0, 0.0, clients)
        current = (self._begun - 1) % number
        total_s = self._connections[current].ended_after_s or 0.0
        played_s = min((self._clock() - self._begun_at_s) * self._speed, total_s)
        return ReplayProgress(current + 1, number, played_s, total_s, clients)

    @property
    def finished(self) -> bool:
        """Whether the last recorded connection has been begun and no client is connected any more."""
        return self._begun >= len(self._connections) and self._server.state.clients == 0

    def poll(self, timeout_s: float) -> None:
        """Serve the clients; waits for the next bytes at most `timeout_s`."""
        self._server.poll(timeout_s)
        if self._server.state.accepted != self._begun:
            self._begun, self._begun_at_s = self._server.state.accepted, self._clock()

    def close(self) -> None:
        """End all connections and stop listening."""
        self._server.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _ending(connection: RecordedConnection) -> RecordedConnection:
    """Return the connection with an end; where the recording stopped first it ends with its last bytes."""
    last_s = connection.chunks[-1][0] if connection.chunks else 0.0
    return replace(connection, ended_after_s=connection.ended_after_s or last_s)


def _faster(connection: RecordedConnection, speed: float) -> RecordedConnection:
    chunks = [(after_s / speed, data) for after_s, data in connection.chunks]
    return RecordedConnection(chunks, (connection.ended_after_s or 0.0) / speed)
