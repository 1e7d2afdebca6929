"""A Crazyradio of the simulated laboratory: packets take their time, some get lost and are repeated.

Durations as documented for Crazyradio PA and 2.0: 1300 packets/s to one vehicle, and 1 ms for each change of
channel, data rate or address. An acknowledgement carries one earlier answer of the vehicle.
"""

import socket
from collections.abc import Callable
from random import Random
from typing import Final

from rcopterx.radios import crazyradio as usb
from rcopterx.radios.crtp import RadioAddress

PACKET_S: Final = 1 / 1300
SETTING_S: Final = 0.001
REPETITION_S: Final = 0.0005
LOST: Final = 0.01
"""Fraction of the transmissions that are lost: an assumption."""


def place_of(laboratory: str, address: RadioAddress) -> str:
    """Name, in the abstract name space of sockets, where a vehicle of a laboratory receives packets."""
    return f"\0{laboratory}/{address.channel}/{address.rate}/{address.address.hex()}"


class EmulatedDongle:
    """A `UsbDevice` in reach of a laboratory's vehicles; `sleep` waits for a duration of their time [s]."""

    def __init__(self, number: int, laboratory: str, sleep: Callable[[float], None]) -> None:
        self._number, self._laboratory, self._sleep = number, laboratory, sleep
        self._random = Random(number).random
        self._channel = self._rate = 0
        self._address = b""
        self._sockets: dict[str, socket.socket] = {}  # of the vehicles by their places
        self._owed_s = 0.0  # by settings, waited for with the next packet
        self._received: list[int] = []

    def ctrl_transfer(self, kind: int, request: int, value: int, index: int, data: bytes | None) -> int:  # noqa: ARG002 - the signature is that of pyusb
        """Configure the dongle."""
        self._owed_s += SETTING_S
        if request == usb.SET_CHANNEL:
            self._channel = value
        elif request == usb.SET_RATE:
            self._rate = value
        elif request == usb.SET_ADDRESS:
            self._address = data or b""
        return 0

    def write(self, endpoint: int, data: bytes, timeout: int) -> int:  # noqa: ARG002 - the signature is that of pyusb
        """Send a packet, again if it gets lost, and wait as long as that takes."""
        place = place_of(
            self._laboratory, RadioAddress(self._number, self._channel, self._rate, self._address)
        )
        lost = next((count for count in range(1 + usb.RETRIES) if self._random() >= LOST), None)
        answer = None if lost is None else self._exchange(place, data)
        repeated = usb.RETRIES if lost is None or answer is None else lost
        self._sleep(self._owed_s + PACKET_S + repeated * REPETITION_S)
        self._owed_s = 0.0
        self._received = [repeated << 4 | (answer is not None and usb.ACKNOWLEDGED), *(answer or b"")]
        return len(data)

    def _exchange(self, place: str, data: bytes) -> bytes | None:
        """Answer that waits at a vehicle, which gets a packet; None if it does not acknowledge it."""
        vehicle = self._sockets.get(place)
        if vehicle is None:
            vehicle = self._sockets[place] = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            vehicle.setblocking(False)
            vehicle.bind("")
        try:
            vehicle.sendto(data, place)
        except OSError:
            return None
        try:
            return vehicle.recv(usb.LONGEST_ANSWER)
        except BlockingIOError:
            return b""

    def read(self, endpoint: int, size: int, timeout: int) -> list[int]:  # noqa: ARG002 - the signature is that of pyusb
        """Return the status of the last packet, and the answer with its acknowledgement."""
        return self._received
