"""Emulated vehicles behind a socket, with a firmware and a battery of their own."""

import socket
from abc import abstractmethod
from contextlib import suppress

from rcopterx.radios.udp import LONGEST_DATAGRAM
from rcopterx.simulator.radio_module import RadioEnd, Reception


class UdpVehicle(Reception):
    """The firmware of one vehicle, without any port or clock; its power is the battery."""

    @abstractmethod
    def receive(self, raw: bytes, now_s: float) -> list[bytes]:
        """Obey a datagram that arrived at `now_s`; return the answers."""

    @abstractmethod
    def advance(self, now_s: float) -> None:
        """Apply time limits until `now_s`."""

    def reports(self, now_s: float) -> list[bytes]:  # noqa: ARG002 - a firmware that only answers
        """Return what it sends without a request."""
        return []


class VehicleUdp(RadioEnd):
    """A vehicle behind a UDP port; it reports to the newest datagram's sender. May raise `OSError`."""

    family = socket.AF_INET

    def __init__(self, address: tuple[str, int] | str, vehicle: UdpVehicle) -> None:
        super().__init__(vehicle)
        self.vehicle = vehicle
        self._address = address
        self._socket: socket.socket | None = self._bound()
        self._peer: tuple[str, int] | bytes | None = None

    def _bound(self) -> socket.socket:
        bound = socket.socket(self.family, socket.SOCK_DGRAM)
        bound.setblocking(False)
        try:
            bound.bind(self._address)
        except OSError:
            bound.close()
            raise
        return bound

    def fileno(self) -> int:
        """See `RadioEnd`."""
        return -1 if self._socket is None else self._socket.fileno()

    def receive(self, now_s: float) -> None:
        """Pass on the datagrams that have arrived, and answer each to its sender."""
        if self._socket is None:
            return
        # A sender that has gone is reported here, and is no concern of the vehicle.
        with suppress(BlockingIOError, ConnectionRefusedError):
            while True:
                raw, self._peer = self._socket.recvfrom(LONGEST_DATAGRAM)
                self._send(self.vehicle.receive(raw, now_s))

    def advance(self, now_s: float) -> None:
        """See `RadioEnd`."""
        self.vehicle.advance(now_s)
        with suppress(BlockingIOError, ConnectionRefusedError):
            self._send(self.vehicle.reports(now_s))

    def _send(self, packets: list[bytes]) -> None:
        for packet in packets:
            if self._socket is not None and self._peer is not None:
                self._socket.sendto(packet, self._peer)

    def unplug(self, *, powered: bool = False) -> None:  # noqa: ARG002 - the vehicle has power of its own
        """Pull the radio: nothing reaches the vehicle."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def replug(self, now_s: float) -> None:  # noqa: ARG002 - the vehicle did not restart
        """Plug the radio in again."""
        if self._socket is None:
            self._socket = self._bound()


class VehicleOnAir(VehicleUdp):
    """A vehicle in reach of an `EmulatedDongle`; without power it is not."""

    family = socket.AF_UNIX

    def switch_off(self) -> None:
        """Remove the battery."""
        super().switch_off()
        self.unplug()

    def switch_on(self, now_s: float) -> None:
        """Put the battery in; the firmware starts."""
        self.replug(now_s)
        super().switch_on(now_s)
