"""Emulated log of a Crazyflie: a table of variables, and blocks of one variable."""

import math
import struct
from typing import Final
from zlib import crc32

from rcopterx.radios import crazyflie_battery as log
from rcopterx.radios.crtp import Packet

FULL_V: Final = 4.2
EMPTY_V: Final = 2.6  # the firmware compensates until then, and the vehicle falls
ENDURANCE_S: Final = 420.0
TABLE: Final = (b"stabilizer\0roll\0", log.VARIABLE, b"stabilizer\0yaw\0")
NO_SUCH: Final = 2


class CrazyflieLog:
    """Blocks are lost when the vehicle starts anew; the voltage falls with the time flown."""

    def __init__(self) -> None:
        self._blocks: dict[int, int] = {}
        self._period_s: dict[int, float] = {}
        self._due_s: dict[int, float] = {}

    def obey(self, packet: Packet, now_s: float) -> Packet | None:
        """Return the answer to a request; None for one that is unknown or too short."""
        data = packet.data
        match (packet.channel, *data):
            case (log.TABLE_CHANNEL, log.GET_INFO, *_):
                answer = struct.pack("<BHIBB", log.GET_INFO, len(TABLE), crc32(b"".join(TABLE)), 16, 128)
            case (log.TABLE_CHANNEL, log.GET_ITEM, _, _):
                item = int.from_bytes(data[1:], "little")
                answer = data + (bytes((log.FLOAT,)) + TABLE[item] if item < len(TABLE) else b"")
            case (log.CONTROL_CHANNEL, _, _, _, *_):
                answer = data[:2] + bytes((self._control(data, now_s),))
            case _:
                return None
        return Packet(log.LOG, packet.channel, answer)

    def _control(self, data: bytes, now_s: float) -> int:
        command, block = data[:2]
        if command == log.CREATE_BLOCK and len(data) == 5:
            if block in self._blocks:
                return log.STARTED_BEFORE
            variable = int.from_bytes(data[3:], "little")
            if variable >= len(TABLE):
                return NO_SUCH
            self._blocks[block] = variable
            return log.NEW
        if command == log.START_BLOCK and block in self._blocks:
            self._period_s[block] = 0.01 * data[2]
            self._due_s[block] = now_s
            return log.NEW
        return NO_SUCH

    def due(self, now_s: float, flown_s: float) -> list[Packet]:
        """Return the data that are due."""
        packets = []
        for block, due_s in self._due_s.items():
            if now_s < due_s:
                continue
            self._due_s[block] = now_s + self._period_s[block]
            voltage_v = FULL_V - (FULL_V - EMPTY_V) * min(flown_s / ENDURANCE_S, 1.0)
            value = voltage_v if TABLE[self._blocks[block]] == log.VARIABLE else math.nan
            stamp = (round(1000 * now_s) % 2**24).to_bytes(3, "little")
            packets.append(
                Packet(log.LOG, log.DATA_CHANNEL, bytes((block,)) + stamp + struct.pack("<f", value))
            )
        return packets
