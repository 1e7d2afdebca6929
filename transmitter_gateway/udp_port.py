"""CRTP over UDP: one packet a datagram, as simulated Crazyflies speak it."""

import socket
from contextlib import suppress
from typing import Final

from rcopterx.transmitter_gateway.port import Port, WriteOutcome
from rcopterx.transmitter_gateway.protocols.crtp import (
    LONGEST_DATAGRAM,
    NULL_PACKET,
    joined,
    separated,
    udp_address,
)

PROBE_S: Final = 0.05
MOST_AT_ONCE: Final = 64
"""Packets, so that a flood keeps no other vehicle waiting."""


class UdpPort(Port):
    """A socket that is open from the first answer to a probe until the system reports the other end gone.

    Raises `ProtocolError` for an address that is none.
    """

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self._address = udp_address(path)
        self._socket: socket.socket | None = None

    def fileno(self) -> int | None:
        """See `Port`."""
        return None if self._socket is None else self._socket.fileno()

    def service(self, now_s: float) -> bool:
        """See `Port`; probes until an answer arrives."""
        if self.is_open or (now_s < self._next_attempt_s and self._socket is None):
            return False
        try:
            if self._socket is None:
                self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                self._socket.setblocking(False)
                self._socket.connect(self._address)
            elif self._receive():
                self.problem = None
                self.counters["openings"] += 1
                return True
            if now_s >= self._next_attempt_s:
                self._socket.send(NULL_PACKET)
                self._next_attempt_s = now_s + PROBE_S
            self.problem = f"no answer from {self.path}"
        except OSError as error:
            self._lose(error, now_s)
        return False

    def _write(self, frame: bytes, now_s: float) -> WriteOutcome:
        """Send the packets of a frame; see `crtp.joined`."""
        if self._socket is None or not self.is_open:
            return WriteOutcome.CLOSED
        try:
            for packet in separated(frame):
                self._socket.send(packet)
        except BlockingIOError:
            return WriteOutcome.BACKLOG
        except OSError as error:
            self._lose(error, now_s)
            return WriteOutcome.FAILED
        return WriteOutcome.WRITTEN

    def read_available(self, now_s: float) -> bytes:
        """Return the packets that have arrived, as a frame."""
        if not self.is_open:
            return b""
        try:
            return joined(self._receive())
        except OSError as error:
            self._lose(error, now_s)
            return b""

    def _receive(self) -> list[bytes]:
        packets: list[bytes] = []
        assert self._socket is not None
        with suppress(BlockingIOError):
            while len(packets) < MOST_AT_ONCE:
                packets.append(self._socket.recv(LONGEST_DATAGRAM))
        return [packet for packet in packets if packet]

    def _lose(self, error: OSError, now_s: float) -> None:
        if self.is_open:
            self.counters["losses"] += 1
        self.close()
        self.problem = f"{self.path}: {error.strerror or error}"
        self._next_attempt_s = now_s + PROBE_S

    def close(self) -> None:
        """See `Port`."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self.problem = None, "closed"
