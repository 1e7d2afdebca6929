"""Trainer-port encoder: ppm-gen on an Arduino."""

from dataclasses import dataclass
from typing import ClassVar

from rcopterx.radios import protocol as base

LINE = base.SerialLine(115_200)
PULSE_RANGE_US = (800.0, 2200.0)
SHORTEST_GAP_S = 1e-3
# The pulses of ppm-gen stop 100 ms after the last packet; the trainer signal itself repeats every 20 ms.
KEEPALIVE_S = 0.025

STX, ETX, SERVO_POSITIONS = 0x01, 0x04, 0x01


@dataclass(frozen=True, slots=True)
class PpmSettings:
    """Settings of the transmitter's trainer port."""

    channels: int = 6
    """Number of trainer channels, 4..8."""
    order: str = "TAER"
    """Order in which the radio expects throttle, aileron, elevator and rudder, such as "TAER" or "AETR"."""

    def __post_init__(self) -> None:
        base.check_ranges(self, "ppm", channels=(4, 8))
        if sorted(self.order) != sorted("TAER"):
            raise base.ProtocolError(
                f"ppm.order: {self.order!r} must be an arrangement of the letters T, A, E, R"
            )

    @property
    def places(self) -> tuple[int, ...]:
        """For every trainer channel the index of our channel it carries."""
        return (*("TAER".index(letter) for letter in self.order), *range(4, self.channels))


class PpmGenProtocol(base.OneWayRadio):
    """Driver of an Arduino with ppm-gen, for a radio that binds, checks range and sets power itself."""

    name: ClassVar[str] = "ppm"
    offers: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, settings: PpmSettings | None = None, line: base.SerialLine = LINE) -> None:
        self.settings = settings or PpmSettings()
        self.line = line
        self.channel_count = self.settings.channels
        self.pulse_range_us = PULSE_RANGE_US
        self.minimum_interval_s = line.duration_s(5 + 2 * self.channel_count) + SHORTEST_GAP_S
        self.keepalive_s = KEEPALIVE_S

    def _frame(self, pulses_us: list[float], flags: base.FrameFlags) -> bytes:  # noqa: ARG002 - it has none
        values = [pulses_us[place] for place in self.settings.places]
        packet = bytearray((STX, 5 + 2 * len(values), SERVO_POSITIONS))
        for value in values:
            packet += round(value).to_bytes(2, "little")
        packet += bytes((sum(packet) & 0xFF, ETX))
        return bytes(packet)

    def decode(self, frame: bytes) -> base.DecodedFrame:
        """Read a channel frame back; raises `FrameDecodeError` if it is no complete one."""
        if len(frame) != 5 + 2 * self.channel_count or frame[1] != len(frame):
            raise base.FrameDecodeError(
                f"ppm: packet of {len(frame)} bytes, {5 + 2 * self.channel_count} are needed"
            )
        if (frame[0], frame[2], frame[-1]) != (STX, SERVO_POSITIONS, ETX):
            raise base.FrameDecodeError("ppm: packet without its marks")
        if sum(frame[:-2]) & 0xFF != frame[-2]:
            raise base.FrameDecodeError("ppm: wrong sum")
        pulses_us = [0.0] * self.channel_count
        for number, place in enumerate(self.settings.places):
            pulses_us[place] = int.from_bytes(frame[3 + 2 * number : 5 + 2 * number], "little")
        return base.DecodedFrame(tuple(pulses_us))
