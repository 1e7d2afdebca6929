"""Vehicles behind a UDP port."""

import math
import socket
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from typing import Final

from rcopterx.background import Address, Start, begin, in_thread, look_up
from rcopterx.radios.set_points import SetPointRadio
from rcopterx.radios.udp import LONGEST_DATAGRAM, udp_address
from rcopterx.transmitter_gateway.port import Port, WriteOutcome
from rcopterx.user_text import ip_version

PROBE_S: Final = 0.05
LOOK_UP_S: Final = 2.0  # between two look-ups of a name while nothing answers at its last address
MOST_AT_ONCE: Final = 64  # datagrams, so that a flood keeps no other vehicle waiting


class UdpPort(Port):
    """A socket that is open from a probe's first answer until the other end is gone.

    `start`: runs look-ups of names, which a name service can block for seconds. The address found is kept;
    while nothing answers there, the name is looked up again.
    """

    retry_s = PROBE_S

    def __init__(self, path: str, protocol: SetPointRadio, start: Start = in_thread) -> None:
        super().__init__(path)
        self._protocol = protocol
        self._host, number = udp_address(path)
        self._look_up, self._start = partial(look_up, self._host, number), start
        named = ip_version(self._host) != 4
        self._address: Address | None = None if named else (self._host, number)
        self._look_up_at_s = -math.inf if named else math.inf
        self._looking_up: Future[Address] | None = None
        self._socket: socket.socket | None = None

    def fileno(self) -> int | None:
        """See `Port`."""
        return None if self._socket is None else self._socket.fileno()

    def service(self, now_s: float) -> bool:
        """See `Port`; probes until an answer arrives."""
        if self.is_open or (now_s < self._next_attempt_s and self._socket is None):
            return False
        try:
            self._find(now_s)
            if self._address is None:
                self._next_attempt_s = now_s + PROBE_S
            elif self._socket is None:
                self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                self._socket.setblocking(False)
                self._socket.bind(("", self._protocol.local_port))
                self._socket.connect(self._address)
            elif self._receive():
                self.problem = None
                self.counters["openings"] += 1
                return True
            if self._socket is not None and now_s >= self._next_attempt_s:
                self._socket.send(self._protocol.probe())
                self._next_attempt_s = now_s + PROBE_S
                self.problem = f"no answer from {self.path}"
        except (OSError, RuntimeError) as error:
            self._lose(_text(self.path, error), now_s)
        return False

    def _find(self, now_s: float) -> None:
        """Look the name up, if there is one and it is time."""
        found = self._looking_up
        if found is None and now_s >= self._look_up_at_s:
            self._look_up_at_s = now_s + LOOK_UP_S
            found = self._looking_up = begin(self._start, self._look_up)
        if found is None:
            return
        if not found.done():
            if self._address is None:
                self.problem = f"{self.path}: the name service has not found {self._host} yet"
            return
        self._looking_up, error = None, found.exception()
        if error is None and found.result() != self._address:
            self.close()
            self._address = found.result()
        elif error is not None and self._address is None:
            self.problem = _text(self.path, error)

    def _write(self, frame: bytes, now_s: float) -> WriteOutcome:
        if self._socket is None or not self.is_open:
            return WriteOutcome.CLOSED
        try:
            for packet in self._protocol.separated(frame):
                self._socket.send(packet)
        except BlockingIOError:
            return WriteOutcome.BACKLOG
        except OSError as error:
            self._lose(_text(self.path, error), now_s)
            return WriteOutcome.FAILED
        return WriteOutcome.WRITTEN

    def read_available(self, now_s: float) -> bytes:
        """Return the datagrams that have arrived, as a frame."""
        if not self.is_open:
            return b""
        try:
            return self._protocol.joined(self._receive())
        except OSError as error:
            self._lose(_text(self.path, error), now_s)
            return b""

    def _receive(self) -> list[bytes]:
        packets: list[bytes] = []
        assert self._socket is not None
        with suppress(BlockingIOError):
            while len(packets) < MOST_AT_ONCE:
                packets.append(self._socket.recv(LONGEST_DATAGRAM))
        return [packet for packet in packets if packet]

    def close(self) -> None:
        """See `Port`."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self.problem = None, "closed"


def _text(path: str, error: BaseException) -> str:
    return f"{path}: {getattr(error, 'strerror', None) or error}"
