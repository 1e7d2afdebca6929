"""14-byte frames for Spektrum radio boards (EdgeTX, `pulses/dsm2.cpp`)."""

import struct
from dataclasses import dataclass
from typing import ClassVar

from rcopterx.radios import protocol as base

CHANNEL_COUNT = 6
FRAME = struct.Struct(f">2B{CHANNEL_COUNT}H")
PERIOD_S = 0.022
LINE = base.SerialLine(125_000)
FAMILIES = {"lp": 0x00, "dsm2": 0x10, "dsmx": 0x18}
BIND = 0x80
RANGE_CHECK = 0x20


@dataclass(frozen=True, slots=True)
class Dsm2Settings:
    """Settings of the frames."""

    model: int = 0
    """Model match number, 0..63."""
    family: str = "dsm2"
    """Radio board: DSM2 only, DSMX/DSM2, or a LP4DSM/LP5DSM board."""

    def __post_init__(self) -> None:
        base.check_ranges(self, "dsm2_serial", model=(0, 63))
        base.check_choice("dsm2_serial.family", self.family, FAMILIES)


class Dsm2SerialProtocol(base.OneWayRadio):
    """Driver of a bare radio board.

    The board answers nothing and is assumed to repeat its last frame for ever, so silence stops no motor. It
    reads the bind flag only just after power-up: power it up while bind frames are sent.
    """

    name: ClassVar[str] = "dsm2_serial"
    offers: ClassVar[frozenset[str]] = frozenset({"bind", "range_check"})
    binds_at_power_up: ClassVar[bool] = True

    def __init__(self, settings: Dsm2Settings | None = None, line: base.SerialLine = LINE) -> None:
        self.settings = settings or Dsm2Settings()
        self.line = line
        self.channel_count = CHANNEL_COUNT
        self.pulse_range_us = base.TEN_BIT_RANGE_US
        self.minimum_interval_s = PERIOD_S
        self.keepalive_s = PERIOD_S

    def _frame(self, pulses_us: list[float], flags: base.FrameFlags) -> bytes:
        """Build a frame of 10-bit values, each with its index; bind and range check exclude each other."""
        if flags.bind and flags.range_check:
            raise base.ProtocolError("dsm2_serial: bind and range check cannot be asked for together")
        header = FAMILIES[self.settings.family]
        header |= (BIND if flags.bind else 0) | (RANGE_CHECK if flags.range_check else 0)
        words = (index << 10 | base.ten_bit_count(pulse_us) for index, pulse_us in enumerate(pulses_us))
        return FRAME.pack(header, self.settings.model, *words)

    def decode(self, frame: bytes) -> base.DecodedFrame:
        """Read a channel frame back; raises `FrameDecodeError` if it is no complete one."""
        if len(frame) != FRAME.size:
            raise base.FrameDecodeError(f"dsm2_serial: frame of {len(frame)} bytes, {FRAME.size} are needed")
        if frame[0] & ~(BIND | RANGE_CHECK) not in FAMILIES.values():
            raise base.FrameDecodeError(f"dsm2_serial: unknown header 0x{frame[0]:02X}")
        pulses = []
        for index, word in enumerate(FRAME.unpack(frame)[2:]):
            if word >> 10 != index:
                raise base.FrameDecodeError(
                    f"dsm2_serial: word {index + 1} says it is channel {(word >> 10) + 1}"
                )
            pulses.append(base.ten_bit_pulse_us(word & 0x3FF))
        flags = base.FrameFlags(bind=bool(frame[0] & BIND), range_check=bool(frame[0] & RANGE_CHECK))
        return base.DecodedFrame(tuple(pulses), flags)
