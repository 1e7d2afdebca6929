"""Trainer-port encoders: ppm-gen on an Arduino, and the SC-8000P."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from rcopterx.transmitter_gateway.protocols.base import (
    DecodedFrame,
    FrameDecodeError,
    FrameFlags,
    OneWayRadio,
    ProtocolError,
    SerialLine,
)

PPM_GEN_LINE = SerialLine(115_200)
SC8000P_LINE = SerialLine(9600)
PULSE_RANGE_US = (800.0, 2200.0)
SHORTEST_GAP_S = 1e-3
# The pulses of ppm-gen stop 100 ms after the last packet; the trainer signal itself repeats every 20 ms.
KEEPALIVE_S = 0.025

STX, ETX, SERVO_POSITIONS = 0x01, 0x04, 0x01
SYNC = b"\x7e\x7e"
DIGITAL_OFF = ord("0")


@dataclass(frozen=True, slots=True)
class PpmSettings:
    """Settings of the transmitter's trainer port.

    Parameters
    ----------
    channels
        Number of trainer channels, 4..8.
    order
        Order in which the radio expects throttle, aileron, elevator and rudder, such as "TAER" or "AETR".
    """

    channels: int = 6
    order: str = "TAER"

    def __post_init__(self) -> None:
        if not 4 <= self.channels <= 8:
            raise ProtocolError(f"ppm.channels: {self.channels} is outside 4..8")
        if sorted(self.order) != sorted("TAER"):
            raise ProtocolError(f"ppm.order: {self.order!r} must be an arrangement of the letters T, A, E, R")

    @property
    def places(self) -> tuple[int, ...]:
        """For every trainer channel the index of our channel it carries."""
        return (*("TAER".index(letter) for letter in self.order), *range(4, self.channels))


class TrainerProtocol(OneWayRadio):
    """Common part of both encoders; the radio itself binds, checks range and sets the power."""

    offers: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, settings: PpmSettings | None, line: SerialLine, frame_length: int) -> None:
        self.settings = settings or PpmSettings()
        self.line = line
        self.channel_count = self.settings.channels
        self.pulse_range_us = PULSE_RANGE_US
        self.minimum_interval_s = line.duration_s(frame_length + 2 * self.channel_count) + SHORTEST_GAP_S
        self.keepalive_s = max(KEEPALIVE_S, self.minimum_interval_s)

    def _arranged(self, pulses_us: Sequence[float]) -> list[float]:
        return [pulses_us[place] for place in self.settings.places]

    def _restored(self, values: Sequence[float]) -> DecodedFrame:
        pulses = [0.0] * self.channel_count
        for place, value in zip(self.settings.places, values, strict=True):
            pulses[place] = value
        return DecodedFrame(tuple(pulses))


class PpmGenProtocol(TrainerProtocol):
    """Driver of an Arduino with the ppm-gen firmware; its pulses stop 100 ms after the last packet."""

    name: ClassVar[str] = "ppm"

    def __init__(self, settings: PpmSettings | None = None, line: SerialLine = PPM_GEN_LINE) -> None:
        super().__init__(settings, line, 5)

    def _frame(self, pulses_us: list[float], flags: FrameFlags) -> bytes:  # noqa: ARG002 - it has none
        values = self._arranged(pulses_us)
        packet = bytearray((STX, 5 + 2 * len(values), SERVO_POSITIONS))
        for value in values:
            packet += round(value).to_bytes(2, "little")
        packet += bytes((sum(packet) & 0xFF, ETX))
        return bytes(packet)

    def decode(self, frame: bytes) -> DecodedFrame:
        """Read a packet back; see `RadioProtocol.decode`."""
        if len(frame) != 5 + 2 * self.channel_count or frame[1] != len(frame):
            raise FrameDecodeError(
                f"ppm: packet of {len(frame)} bytes, {5 + 2 * self.channel_count} are needed"
            )
        if (frame[0], frame[2], frame[-1]) != (STX, SERVO_POSITIONS, ETX):
            raise FrameDecodeError("ppm: packet without its marks")
        if sum(frame[:-2]) & 0xFF != frame[-2]:
            raise FrameDecodeError("ppm: wrong sum")
        words = frame[3:-2]
        return self._restored([int.from_bytes(words[i : i + 2], "little") for i in range(0, len(words), 2)])


class Sc8000pProtocol(TrainerProtocol):
    """Driver of an SC-8000P; order of the mask bits and time-out of the device are not verified."""

    name: ClassVar[str] = "sc8000p"

    def __init__(self, settings: PpmSettings | None = None, line: SerialLine = SC8000P_LINE) -> None:
        super().__init__(settings, line, 4)

    def _frame(self, pulses_us: list[float], flags: FrameFlags) -> bytes:  # noqa: ARG002 - it has none
        values = self._arranged(pulses_us)
        message = bytearray(SYNC) + bytes(((1 << len(values)) - 1, DIGITAL_OFF))
        for value in values:
            message += round(10 * value).to_bytes(2, "big")
        return bytes(message)

    def decode(self, frame: bytes) -> DecodedFrame:
        """Read a message back; see `RadioProtocol.decode`."""
        if len(frame) != 4 + 2 * self.channel_count or not frame.startswith(SYNC):
            raise FrameDecodeError("sc8000p: not a message for this number of channels")
        if frame[2] != (1 << self.channel_count) - 1:
            raise FrameDecodeError(f"sc8000p: mask 0x{frame[2]:02X} is not for {self.channel_count} channels")
        words = frame[4:]
        return self._restored([int.from_bytes(words[i : i + 2], "big") / 10 for i in range(0, len(words), 2)])
