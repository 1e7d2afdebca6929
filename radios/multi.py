"""Multiprotocol serial protocol (DIY-Multiprotocol-TX-Module): 27-byte frames, TLV answers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from msgspec import Struct

from rcopterx.radios import protocol as base
from rcopterx.radios.multi_answers import AnswerParser
from rcopterx.radios.multi_radios import DSM, RADIOS
from rcopterx.tables import table_beside

FRAME_LENGTH = 27
CHANNEL_COUNT = 16
CHANNELS_AT = 4
CHANNEL_BYTES = 22
CENTER_COUNT = 1024
KILL_COUNT = 204
KILL_CHANNEL, AUTOBIND_CHANNEL = 13, 15  # the latter: above its centre a module binds if `autobind` is set
COUNTS_PER_US = 820 / 400

LINE = base.SerialLine(100_000, parity="E", stop_bits=2)
SHORTEST_GAP_S = 1e-3
MODULE_SILENT_S = 2.0
LONGEST_GAP_S = 0.05  # the module reports that it receives no frames when none has arrived for 70 ms
FIRST_FRAME_S = 0.1  # from the first frame until the module has certainly received one, on a busy computer

FLAGS = table_beside(__file__, "multi_flags")
"""Byte and bit of each flag of a frame."""


def count_of(pulse_us: float) -> int:
    """11-bit value of a pulse width [us]."""
    return min(max(round(CENTER_COUNT + (pulse_us - base.CENTER_US) * COUNTS_PER_US), 0), 2047)


def pulse_of(count: int) -> float:
    """Pulse width [us] of an 11-bit value."""
    return base.CENTER_US + (count - CENTER_COUNT) / COUNTS_PER_US


def pack_channels(counts: Sequence[int]) -> bytes:
    """Pack 16 values of 11 bits into 22 bytes, first channel in the lowest bits; raises `PulseRangeError`."""
    if len(counts) != CHANNEL_COUNT:
        raise base.PulseRangeError(f"multi: {len(counts)} channel values given, exactly 16 are needed")
    if min(counts) < 0 or max(counts) > 2047:
        index, count = next((n, count) for n, count in enumerate(counts) if not 0 <= count <= 2047)
        raise base.PulseRangeError(f"multi: channel {index + 1} value {count} is outside 0..2047")
    stream = sum(count << 11 * channel for channel, count in enumerate(counts))
    return stream.to_bytes(CHANNEL_BYTES, "little")


def unpack_channels(packed: bytes) -> tuple[int, ...]:
    """Read 16 values of 11 bits from 22 bytes."""
    stream = int.from_bytes(packed, "little")
    return tuple(stream >> 11 * channel & 0x7FF for channel in range(CHANNEL_COUNT))


class MultiFrame(Struct, frozen=True):
    """Every field of a frame on the wire ; `counts` being the 16 channel values."""

    counts: tuple[int, ...]
    protocol: int = DSM
    sub_protocol: int = 0
    rx_num: int = 0
    option: int = 6
    bind: bool = False
    autobind: bool = False
    range_check: bool = False
    low_power: bool = False
    failsafe: bool = False
    inverted_line: bool = True
    telemetry_off: bool = False
    mapping_off: bool = True

    @property
    def ordered_counts(self) -> tuple[int, ...]:
        """Channels, throttle, aileron, elevator, rudder first; without mapping off they are A, E, T, R."""
        return self.counts if self.mapping_off else (self.counts[2], *self.counts[:2], *self.counts[3:])

    @property
    def kill_count(self) -> int:
        """Value of channel 14, which with DSM stops the motors at `KILL_COUNT` and below."""
        return self.counts[KILL_CHANNEL]

    @property
    def kills(self) -> bool:
        """Whether channel 14 stops the motors."""
        return self.protocol == DSM and self.kill_count <= KILL_COUNT

    def to_bytes(self) -> bytes:
        """Encode as the 27 bytes of the wire format."""
        header = 0x54 if self.protocol & 0x20 else 0x55
        second = self.rx_num & 0x0F | (self.sub_protocol & 0x07) << 4
        frame = bytearray((header, self.protocol & 0x1F, second, self.option))
        frame += pack_channels(self.counts)
        frame.append(self.protocol & 0xC0 | self.rx_num & 0x30)
        for flag, (byte, bit) in FLAGS.items():
            frame[byte] |= bit if getattr(self, flag) else 0
        return bytes(frame)

    @staticmethod
    def from_bytes(frame: bytes) -> "MultiFrame":
        """Decode a frame of 26 to 36 bytes, of which 27 count; raises `FrameDecodeError`."""
        if not 26 <= len(frame) <= 36:
            raise base.FrameDecodeError(f"multi: frame of {len(frame)} bytes, 26 to 36 are possible")
        if frame[0] & 0xFC != 0x54:
            raise base.FrameDecodeError(f"multi: header 0x{frame[0]:02X}, expected 0x54 to 0x57")
        header, first, second, option = frame[:CHANNELS_AT]
        frame = frame.ljust(FRAME_LENGTH, b"\0")
        last = frame[26]
        return MultiFrame(
            counts=unpack_channels(frame[CHANNELS_AT:26]),
            protocol=first & 0x1F | (0 if header & 0x01 else 0x20) | last & 0xC0,
            sub_protocol=second >> 4 & 0x07,
            rx_num=second & 0x0F | last & 0x30,
            option=option,
            **{flag: bool(frame[byte] & bit) for flag, (byte, bit) in FLAGS.items()},
        )


@dataclass(frozen=True, slots=True)
class MultiSettings:
    """Settings of the module."""

    rx_num: int = 0
    """Model match number, 0..63; each vehicle has its own."""
    radio: str = "DSM"
    """Radio protocol, by the name that the module reports: DSM, E129, OMP, ..."""
    sub_protocol: int = 0
    """Its sub-protocol; of DSM 0 DSM2_1F (22 ms, 1024), 1 DSM2_2F (2048), 2 DSMX_1F (22 ms, 2048), 3 DSMX_2F.
    """
    option: int = 0
    """Option byte, such as the frequency tuning of radio protocols on a CC2500; DSM uses the next two."""
    channels: int = 6
    """Number of channels on air with DSM, 4..12."""
    eleven_ms: bool = False
    """Send data every 11 ms (sub-protocols 1 and 3 of DSM)."""
    inverted_line: bool = True
    """Polarity bit: True for a JR-bay module on an inverted line, False for an internal one. A wrong value
    makes the module deaf until it is power cycled."""
    answers_wired: bool = True
    """False when the module's return line is not connected; readiness is then assumed."""

    def __post_init__(self) -> None:
        base.check_choice("multi.radio", self.radio, RADIOS)
        last = len(RADIOS[self.radio].sub_protocols) - 1
        base.check_ranges(
            self, "multi", rx_num=(0, 63), sub_protocol=(0, last), option=(-128, 127), channels=(4, 12)
        )

    @property
    def option_byte(self) -> int:
        """The option byte; for DSM number of channels and the 11 ms bit."""
        if RADIOS[self.radio].number == DSM:
            return self.channels | (0x40 if self.eleven_ms else 0)
        return self.option & 0xFF


class MultiProtocol(base.OneWayRadio):
    """Driver of a Multiprotocol module; never asks for autobind and keeps the channel mapping off.

    Without a wire for its answers it counts as ready after a time.
    """

    name: ClassVar[str] = "multi"
    offers: ClassVar[frozenset[str]] = frozenset({"bind", "range_check", "kill", "low_power"})
    settling_s = MODULE_SILENT_S

    def __init__(self, settings: MultiSettings | None = None, line: base.SerialLine = LINE) -> None:
        self.settings = settings or MultiSettings()
        self._radio = RADIOS[self.settings.radio]
        self._taer = self._radio.taer
        self.line = line
        self.channel_count = CHANNEL_COUNT
        self.pulse_range_us = (1000.0, 2000.0)
        # The module's line has 12 bits a byte even where a pseudo-terminal is configured with fewer.
        longest_line = max(line.duration_s(FRAME_LENGTH), LINE.duration_s(FRAME_LENGTH))
        self.minimum_interval_s = longest_line + SHORTEST_GAP_S
        # A little above the command period of 20 ms: a keep-alive just before a late command delays it by
        # the time of a frame. The module's dead-man's stop is at 70 ms.
        self.keepalive_s = 0.025
        self._parser = AnswerParser()
        self._frames_since_s = self._last_frame_s = -math.inf
        self._answered_s = -math.inf
        self._answered: base.ModuleStatus | None = None

    @property
    def channels_on_air(self) -> int:
        """See `RadioProtocol`; frames always have 16."""
        return self.settings.channels if self._taer else self._radio.channels

    def check(self, pulses_us: Sequence[float]) -> list[float]:
        """See `RadioProtocol.check`; with DSM channel 14, which kills, rests in its centre."""
        pulses = super().check(pulses_us)
        if self._taer and len(pulses_us) <= KILL_CHANNEL:
            pulses[KILL_CHANNEL] = base.CENTER_US
        return pulses

    def _frame(self, pulses_us: list[float], flags: base.FrameFlags) -> bytes:
        """Build a frame; with DSM channel 14 is -100 % for kill only."""
        counts = [count_of(pulse_us) for pulse_us in pulses_us]
        if not self._taer:
            counts[:3] = counts[1], counts[2], counts[0]
        elif flags.kill:
            counts[KILL_CHANNEL] = KILL_COUNT
        return MultiFrame(
            counts=tuple(counts),
            protocol=self._radio.number,
            mapping_off=self._taer,
            sub_protocol=self.settings.sub_protocol,
            rx_num=self.settings.rx_num,
            option=self.settings.option_byte,
            bind=flags.bind,
            range_check=flags.range_check,
            low_power=flags.low_power,
            inverted_line=self.settings.inverted_line,
            telemetry_off=not self.settings.answers_wired,
        ).to_bytes()

    def link_opened(self, now_s: float) -> None:
        """Wait for a new status answer."""
        super().link_opened(now_s)
        self._parser = AnswerParser()
        self._answered = None

    def link_resumed(self, now_s: float) -> None:
        """Count the module as ready, as if it had just reported it."""
        super().link_resumed(now_s)
        self._answered = base.ModuleStatus(True, False, "ready, by an earlier process")
        self._answered_s = now_s

    def frame_written(self, now_s: float) -> None:
        """Note that a frame was written, and since when frames follow each other."""
        if now_s > self._last_frame_s + LONGEST_GAP_S:
            self._frames_since_s = now_s
        self._last_frame_s = now_s

    def receive(self, data: bytes, now_s: float) -> None:
        """Parse answers and keep the newest status.

        The module reports twice a second. That it receives no frames means nothing in a pause of this
        gateway, and shortly after one.
        """
        for status in self._parser.feed(data):
            has_frames = self._frames_since_s + FIRST_FRAME_S <= now_s <= self._last_frame_s + LONGEST_GAP_S
            if status.has_input or has_frames:
                self._answered = status.judged(self.settings.radio)
                self._answered_s = now_s

    def status(self, now_s: float) -> base.ModuleStatus:
        """Ready when the module reports it and its last answer is at most 2 s old."""
        if self._opened_s is None or not self.settings.answers_wired:
            return super().status(now_s)
        if self._answered is None:
            return base.ModuleStatus(
                False, False, "no answer from the module yet; check power, wiring and polarity"
            )
        if now_s - self._answered_s > MODULE_SILENT_S:
            return base.ModuleStatus(
                False, False, f"module gone: silent for {now_s - self._answered_s:.1f} s"
            )
        return self._answered
