"""One connection of the Tracker emulator: bytes on their way to a client, with their times."""

import contextlib
import math
import socket
import struct
from collections import deque

from rcopterx.simulator.faults import Dribble
from rcopterx.simulator.tracker_session import TrackerConnection

RECEIVE_BYTES = 64 * 1024


class TrackerLink:
    """One connection: its protocol state and the bytes on their way to it."""

    def __init__(self, accepted: socket.socket, connection: TrackerConnection) -> None:
        self.socket = accepted
        self.connection = connection
        self.held: list[bytes] = []
        self.outgoing = bytearray()
        self.next_chunk_s = 0.0
        self.blocked = False
        self._waiting: deque[tuple[float, bytes | None]] = deque()
        self._waiting_bytes = 0
        self.ended = False

    @property
    def backlog_bytes(self) -> int:
        """Bytes not sent yet."""
        return len(self.outgoing) + self._waiting_bytes

    @property
    def due_s(self) -> float:
        """When the next bytes that wait become due, infinite without any."""
        return self._waiting[0][0] if self._waiting else math.inf

    def queue(self, data: bytes | None, due_s: float) -> None:
        """Send bytes at `due_s`, or end the connection with None; never before earlier bytes."""
        if self._waiting:
            due_s = max(due_s, self._waiting[-1][0])
        self._waiting.append((due_s, data))
        self._waiting_bytes += len(data or b"")

    def send(self, now_s: float, dribble: Dribble | None) -> None:
        """Send the bytes that are due, as far as the socket accepts them."""
        while self._waiting and self._waiting[0][0] <= now_s:
            data = self._waiting.popleft()[1]
            self._waiting_bytes -= len(data or b"")
            self.outgoing += data or b""
            self.ended = self.ended or data is None
        self.blocked = False
        try:
            if dribble is None:
                del self.outgoing[: self._send(self.outgoing)]
                return
            self.next_chunk_s = max(self.next_chunk_s, now_s - 0.1)
            while self.outgoing and self.next_chunk_s <= now_s:
                del self.outgoing[: self._send(self.outgoing[: dribble.chunk_bytes])]
                self.next_chunk_s += max(dribble.interval_s, 1e-6)
        except BlockingIOError:
            self.blocked = True

    def _send(self, data: bytearray) -> int:
        return self.socket.send(data) if data else 0

    def close(self, reset: bool = False) -> None:
        """Close the connection, in order or with a reset."""
        if reset:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        else:
            with contextlib.suppress(OSError):
                self.socket.shutdown(socket.SHUT_WR)
                self.socket.recv(RECEIVE_BYTES)  # bytes left unread would turn the end into a reset
        self.socket.close()
