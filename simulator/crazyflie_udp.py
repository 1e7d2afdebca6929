"""An emulated Crazyflie that speaks CRTP over UDP: one packet a datagram."""

import socket
from contextlib import suppress

from rcopterx.simulator.crazyflie import Crazyflie
from rcopterx.simulator.radio_end import RadioEnd
from rcopterx.transmitter_gateway.protocols.crtp import LONGEST_DATAGRAM, udp_address


class CrazyflieUdp(RadioEnd):
    """A vehicle behind a UDP port, with a battery of its own.

    Raises `OSError` if the port is in use.
    """

    def __init__(self, path: str, vehicle: Crazyflie) -> None:
        super().__init__(vehicle)
        self.vehicle = vehicle
        self._address = udp_address(path)
        self._socket: socket.socket | None = self._bound()

    def _bound(self) -> socket.socket:
        bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        bound.setblocking(False)
        try:
            bound.bind(self._address)
        except OSError:
            bound.close()
            raise
        return bound

    @property
    def is_open(self) -> bool:
        """See `RadioEnd`."""
        return self._socket is not None

    def fileno(self) -> int:
        """See `RadioEnd`."""
        return -1 if self._socket is None else self._socket.fileno()

    def receive(self, now_s: float) -> None:
        """Pass on the packets that have arrived, and answer each to its sender."""
        if self._socket is None:
            return
        # A sender that has gone is reported here, and is no concern of the vehicle.
        with suppress(BlockingIOError, ConnectionRefusedError):
            while True:
                raw, sender = self._socket.recvfrom(LONGEST_DATAGRAM)
                for answer in self.vehicle.receive(raw, now_s):
                    self._socket.sendto(answer, sender)

    def live(self, now_s: float) -> None:
        """See `RadioEnd`."""
        self.vehicle.advance(now_s)

    def unplug(self, *, powered: bool = False) -> None:  # noqa: ARG002 - the vehicle has power of its own
        """Pull the radio: nothing reaches the vehicle."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def replug(self, now_s: float) -> None:  # noqa: ARG002 - the vehicle did not restart
        """Plug the radio in again."""
        if self._socket is None:
            self._socket = self._bound()

    def switch_off(self) -> None:
        """Take the battery out."""
        self.vehicle.switch_off()

    def switch_on(self, now_s: float) -> None:
        """Put the battery in; the firmware starts."""
        if not self.vehicle.powered:
            self.vehicle.power_cycle(now_s)
