"""Battery voltage of a Crazyflie from its log (format: documentation of crazyflie-firmware, log)."""

import math
import struct

from rcopterx.radios.crtp import Packet
from rcopterx.radios.protocol import FrameDecodeError

LOG = 5
TABLE_CHANNEL, CONTROL_CHANNEL, DATA_CHANNEL = 0, 1, 2
GET_ITEM, GET_INFO = 2, 3
START_BLOCK, CREATE_BLOCK = 3, 6
BLOCK = 0x52
PERIOD_10_MS = 100
FLOAT = 7
VARIABLE = b"pm\0vbat\0"
NEW, STARTED_BEFORE = 0, 17  # results of creating a block
PATIENCE_FRAMES = 200  # frames without a voltage after which the vehicle may have started anew


class BatteryLog:
    """Finds the voltage in the table of the log, item by item, and subscribes: `voltage_v`, if known."""

    def __init__(self) -> None:
        self.voltage_v: float | None = None
        self._items: int | None = None
        self._item = 0
        self._found = self._created = self._started = False
        self._frames = 0

    def request(self) -> Packet | None:
        """Return what to ask for next, once a frame; None when nothing is missing."""
        if self._started:
            self._frames += 1
            if self._frames > PATIENCE_FRAMES:
                self._created = self._started = False
        if self._started or (self._items is not None and self._item >= self._items):
            return None
        if self._items is None:
            return Packet(LOG, TABLE_CHANNEL, bytes((GET_INFO,)))
        item = self._item.to_bytes(2, "little")
        if not self._found:
            return Packet(LOG, TABLE_CHANNEL, bytes((GET_ITEM,)) + item)
        if not self._created:
            return Packet(LOG, CONTROL_CHANNEL, bytes((CREATE_BLOCK, BLOCK, FLOAT << 4 | FLOAT)) + item)
        return Packet(LOG, CONTROL_CHANNEL, bytes((START_BLOCK, BLOCK, PERIOD_10_MS)))

    def take(self, packet: Packet) -> None:
        """Take a packet of the log port; raises `FrameDecodeError` for a malformed one."""
        data = packet.data
        try:
            if packet.channel == DATA_CHANNEL and data[0] == BLOCK:
                (voltage_v,) = struct.unpack_from("<f", data, 4)
                if not math.isfinite(voltage_v):
                    raise FrameDecodeError("crtp: a voltage that is not finite")
                self.voltage_v, self._frames = voltage_v, 0
            elif packet.channel == TABLE_CHANNEL and data[0] == GET_INFO:
                (self._items,) = struct.unpack_from("<H", data, 1)
            elif packet.channel == TABLE_CHANNEL and data[0] == GET_ITEM:
                self._judge(struct.unpack_from("<H", data, 1)[0], data[3:])
            elif packet.channel == CONTROL_CHANNEL and data[1] == BLOCK:
                self._created = self._created or (
                    data[0] == CREATE_BLOCK and data[2] in (NEW, STARTED_BEFORE)
                )
                self._started = self._started or (data[0] == START_BLOCK and data[2] == NEW)
        except (IndexError, struct.error):
            raise FrameDecodeError("crtp: packet of the log that is too short") from None

    def _judge(self, item: int, entry: bytes) -> None:
        if item != self._item or self._found:
            return
        if entry == bytes((FLOAT,)) + VARIABLE:
            self._found = True
        else:
            self._item += 1
