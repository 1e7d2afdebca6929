"""The Crazyradio on USB (protocol: Crazyradio, USB and radio protocol): requests and endpoints."""

from collections.abc import Sequence
from typing import Final, Protocol

RADIO: Final = "radio://"  # beginning of addresses
VENDOR, PRODUCT = 0x1915, 0x7777
TO_DEVICE: Final = 0x40
SET_CHANNEL, SET_ADDRESS, SET_RATE, SET_POWER, SET_RETRIES = 0x01, 0x02, 0x03, 0x04, 0x06
FULL_POWER: Final = 3
RETRIES: Final = 3
OUT, IN = 0x01, 0x81
LONGEST_ANSWER: Final = 64
TIMEOUT_MS: Final = 100
ACKNOWLEDGED: Final = 0x01
MISSING_LIBRARY: Final = "the library pyusb is not installed: pip install 'rcopterx[crazyflie]'"


class UsbDevice(Protocol):
    """What is used of a device of `pyusb`; all members raise `OSError` when it is gone."""

    def ctrl_transfer(self, kind: int, request: int, value: int, index: int, data: bytes | None) -> int:
        """Configure the dongle."""

    def write(self, endpoint: int, data: bytes, timeout: int) -> int:
        """Send a packet."""

    def read(self, endpoint: int, size: int, timeout: int) -> Sequence[int]:
        """Return the status of a transfer and the packet of the vehicle, if any."""


def find_dongle(number: int) -> UsbDevice:
    """Return a dongle, counted from 0; raises `OSError` if it is not there or cannot be used."""
    try:
        import usb.core
    except ImportError:
        raise OSError(MISSING_LIBRARY) from None
    try:
        dongles = list(usb.core.find(find_all=True, idVendor=VENDOR, idProduct=PRODUCT))
    except usb.core.NoBackendError:
        raise OSError("the system library libusb-1.0 is not installed") from None
    if number >= len(dongles):
        raise OSError(f"there are {len(dongles)} Crazyradios, number {number} is not plugged in")
    device: UsbDevice = dongles[number]
    return device
