"""Emulated services of a Crazyflie that clients use to connect: link, version, parameters, memories."""

import struct
from typing import Final
from zlib import crc32

from rcopterx.transmitter_gateway.protocols.crtp import LONGEST_DATA, Packet

PROTOCOL_VERSION: Final = 12
IDENTITY: Final = b"Bitcraze Crazyflie".ljust(LONGEST_DATA, b"\0")
BYTE: Final = 0x08
TABLE: Final = ((b"stabilizer\0estimator\0", 2), (b"stabilizer\0controller\0", 1))
"""Names and values of the parameters, all of a byte."""


def served(packet: Packet) -> Packet | None:
    """Return the answer to a request; None for one that is unknown."""
    data = packet.data
    answer: bytes | None = None
    match (packet.port, packet.channel, data[:1]):
        case (15, 0, _):
            answer = data
        case (15, 1, _):
            answer = IDENTITY
        case (13, 1, b"\0"):
            answer = bytes((0, PROTOCOL_VERSION))
        case (2, 0, b"\3"):
            answer = struct.pack("<BHI", 3, len(TABLE), crc32(repr(TABLE).encode()))
        case (2, 0, b"\2") if len(data) == 3 and (item := _item(data[1:])) is not None:
            answer = data + bytes((BYTE,)) + TABLE[item][0]
        case (2, 1, _) if len(data) == 2 and (item := _item(data)) is not None:
            answer = data + bytes((0, TABLE[item][1]))
        case (4, 0, b"\1"):
            answer = b"\1\0"
    return None if answer is None else Packet(packet.port, packet.channel, answer)


def _item(raw: bytes) -> int | None:
    item = int.from_bytes(raw, "little")
    return item if item < len(TABLE) else None
