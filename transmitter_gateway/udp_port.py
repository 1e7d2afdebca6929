"""Vehicles behind a UDP port."""

import socket
from contextlib import suppress
from typing import Final

from rcopterx.transmitter_gateway.port import Port, WriteOutcome
from rcopterx.transmitter_gateway.protocols.base import ProtocolError
from rcopterx.transmitter_gateway.protocols.set_points import SetPointRadio

UDP: Final = "udp://"
LONGEST_DATAGRAM: Final = 2048
PROBE_S: Final = 0.05
MOST_AT_ONCE: Final = 64  # datagrams, so that a flood keeps no other vehicle waiting


def udp_address(path: str) -> tuple[str, int]:
    """Host and port of `udp://HOST:PORT`; raises `ProtocolError` for anything else."""
    host, _, port = path.removeprefix(UDP).rpartition(":")
    if not path.startswith(UDP) or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ProtocolError(f"{path!r} is no address such as udp://127.0.0.1:19850")
    return host, int(port)


class UdpPort(Port):
    """A socket that is open from a probe's first answer until the other end is gone."""

    def __init__(self, path: str, protocol: SetPointRadio) -> None:
        super().__init__(path)
        self._protocol = protocol
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
                self._socket.bind(("", self._protocol.local_port))
                self._socket.connect(self._address)
            elif self._receive():
                self.problem = None
                self.counters["openings"] += 1
                return True
            if now_s >= self._next_attempt_s:
                self._socket.send(self._protocol.probe())
                self._next_attempt_s = now_s + PROBE_S
            self.problem = f"no answer from {self.path}"
        except OSError as error:
            self._lose(error, now_s)
        return False

    def _write(self, frame: bytes, now_s: float) -> WriteOutcome:
        if self._socket is None or not self.is_open:
            return WriteOutcome.CLOSED
        try:
            for packet in self._protocol.separated(frame):
                self._socket.send(packet)
        except BlockingIOError:
            return WriteOutcome.BACKLOG
        except OSError as error:
            self._lose(error, now_s)
            return WriteOutcome.FAILED
        return WriteOutcome.WRITTEN

    def read_available(self, now_s: float) -> bytes:
        """Return the datagrams that have arrived, as a frame."""
        if not self.is_open:
            return b""
        try:
            return self._protocol.joined(self._receive())
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
