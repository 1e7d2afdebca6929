"""Lemon-Rx DSMP module (EdgeTX, `pulses/dsmp.cpp`): set-up and channel frames, answers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from rcopterx.radios import protocol as base

LINE = base.SerialLine(115_200)
FIRMWARE_1_PERIOD_S = 0.02206
FIRMWARE_2_PERIOD_S = 0.011

START = 0xAA
DEBUG_START = 0xAB
SETUP = 0
WORDS = 7
SETUP_LENGTH = 6
CHANNELS_LENGTH = 2 + 2 * WORDS
EMPTY = 0xFFFF

DSMX, FAST, ELEVEN_BIT = 0x01, 0x02, 0x04
BIND_AUTO = 0xC0
NORMAL_POWER, RANGE_CHECK_POWER = 7, 4

SETUP_EVERY = 100
FIRMWARE_1_SETUP_EVERY = 2
FIRMWARE_1_SETUPS = 50

BIND_RESULT, BIND_RESULT_LENGTH = 0x80, 12
RECEIVER_CHANNELS = range(3, 15)
RECEIVER_MODES = frozenset({0x01, 0x02, 0x12, 0xA2, 0xB2})  # DSM2 and DSMX, 22 and 11 ms
VERSION, ANSWER_LENGTH = 0xFF, 18
KNOWN_FIRMWARES = (1, 2)


@dataclass(frozen=True, slots=True)
class DsmpSettings:
    """Settings of the module."""

    model: int = 0
    """Model match number, 0..255; firmware 1 ignores it."""
    channels: int = 6
    """Number of channels, 4..12."""
    dsmx: bool = False
    eleven_ms: bool = False
    eleven_bit: bool = False
    """`dsmx`, `eleven_ms`, `eleven_bit`: DSMX instead of DSM2, 11 ms instead of 22 ms, 2048 instead of 1024
    steps."""

    def __post_init__(self) -> None:
        base.check_ranges(self, "dsmp", model=(0, 255), channels=(4, 12))

    @property
    def mode(self) -> int:
        """The flags byte of a set-up frame without bind."""
        return self.dsmx * DSMX | self.eleven_ms * FAST | self.eleven_bit * ELEVEN_BIT


class DsmpProtocol(base.OneWayRadio):
    """Driver of a DSMP module: every `encode` gives the next frame of its schedule.

    A set-up frame comes first, then every 100 channel frames, and at once when power or bind change. On
    firmware 1 the first 50 come every 2 channel frames. More than 7 channels alternate between two passes.
    """

    name: ClassVar[str] = "dsmp"
    offers: ClassVar[frozenset[str]] = frozenset({"bind", "range_check"})

    def __init__(self, settings: DsmpSettings | None = None, line: base.SerialLine = LINE) -> None:
        self.settings = settings or DsmpSettings()
        self.line = line
        self.channel_count = self.settings.channels
        self.pulse_range_us = base.TEN_BIT_RANGE_US
        self._decoded = [base.CENTER_US] * (2 * WORDS)
        self._forget()

    def _forget(self) -> None:
        self.minimum_interval_s = self.keepalive_s = FIRMWARE_1_PERIOD_S
        self._firmware = 1
        self._version: str | None = None
        self._reported: tuple[int, int] | None = None
        self._buffer = bytearray()
        self._setup: bytes | None = None
        self._setups_sent = 0
        self._frames_since_setup = 0
        self._pass = 1
        self._binding = False
        self._bind_requested = False

    def link_opened(self, now_s: float) -> None:
        """Restart the schedule."""
        super().link_opened(now_s)
        self._forget()

    def _frame(self, pulses_us: list[float], flags: base.FrameFlags) -> bytes:
        if flags.bind and not self._bind_requested:
            self._binding = True
        self._bind_requested = flags.bind
        setup = self._setup_frame(flags)
        if setup != self._setup or self._frames_since_setup >= self._setup_every(flags):
            self._setup = setup
            self._setups_sent += 1
            self._frames_since_setup = 0
            return setup
        self._frames_since_setup += 1
        frame = self._channel_frame(pulses_us, self._pass)
        self._pass = 2 if self._pass == 1 and self.channel_count > WORDS else 1
        return frame

    def _setup_every(self, flags: base.FrameFlags) -> int:
        if flags.bind:
            return 1
        fast = self._firmware == 1 and self._setups_sent < FIRMWARE_1_SETUPS
        return FIRMWARE_1_SETUP_EVERY if fast else SETUP_EVERY

    def _setup_frame(self, flags: base.FrameFlags) -> bytes:
        settings = self.settings
        mode = BIND_AUTO if flags.bind else settings.mode
        power = RANGE_CHECK_POWER if flags.range_check else NORMAL_POWER
        return bytes((START, SETUP, mode, power, settings.channels, settings.model))

    def _channel_frame(self, pulses: Sequence[float], number: int) -> bytes:
        frame = bytearray((START, number))
        first = (number - 1) * WORDS
        for index in range(first, first + WORDS):
            word = EMPTY if index >= len(pulses) else self._word(index, pulses[index])
            frame += word.to_bytes(2, "big")
        return bytes(frame)

    def _word(self, index: int, pulse_us: float) -> int:
        if not self.settings.eleven_bit:
            return index << 10 | base.ten_bit_count(pulse_us)
        return index << 11 | min(
            max(round(1024 + 2 * (pulse_us - base.CENTER_US) / base.TEN_BIT_US), 0), 2047
        )

    def decode(self, frame: bytes) -> base.DecodedFrame:
        """Read a channel frame back, together with the last frame of the other pass."""
        if len(frame) != CHANNELS_LENGTH or frame[0] != START or frame[1] not in (1, 2):
            raise base.FrameDecodeError("dsmp: not a channel frame")
        bits = 11 if self.settings.eleven_bit else 10
        for place in range(WORDS):
            word = int.from_bytes(frame[2 + 2 * place : 4 + 2 * place], "big")
            if word == EMPTY:
                continue
            index = word >> bits
            if index != (frame[1] - 1) * WORDS + place:
                raise base.FrameDecodeError(f"dsmp: word {place + 1} says it is channel {index + 1}")
            count = word & ((1 << bits) - 1)
            self._decoded[index] = base.ten_bit_pulse_us(count / 2 if bits == 11 else count)
        return base.DecodedFrame(tuple(self._decoded[: self.channel_count]))

    def receive(self, data: bytes, now_s: float) -> None:  # noqa: ARG002 - the interface gives the time
        """Parse answers: bind result, version, telemetry, debug text."""
        self._buffer += data
        while (answer := self._next_answer()) is not None:
            if answer[0] == START and answer[1] == BIND_RESULT:
                # It comes once and has no checksum: noise would end the bind.
                plausible = answer[4] in RECEIVER_CHANNELS and answer[5] in RECEIVER_MODES
                self._binding = self._binding and not plausible
            elif answer[0] == START and answer[1] == VERSION:
                self._take_version(answer[6], answer[7])

    def _next_answer(self) -> bytes | None:
        while self._buffer and self._buffer[0] not in (START, DEBUG_START):
            del self._buffer[0]
        if len(self._buffer) < 2:
            return None
        if self._buffer[0] == DEBUG_START:
            length = 2 + self._buffer[1]
        else:
            length = BIND_RESULT_LENGTH if self._buffer[1] == BIND_RESULT else ANSWER_LENGTH
        if len(self._buffer) < length:
            return None
        answer = bytes(self._buffer[:length])
        del self._buffer[:length]
        return answer

    def _take_version(self, major: int, minor: int) -> None:
        """Accept a known version that is reported twice in a row: answers have no checksum."""
        known = (major, minor) if major in KNOWN_FIRMWARES else None
        if known is not None and known == self._reported:
            self._firmware = major
            self._version = f"{major}.{minor}"
            period_s = FIRMWARE_2_PERIOD_S if major == 2 else FIRMWARE_1_PERIOD_S
            self.minimum_interval_s = self.keepalive_s = period_s
        self._reported = known

    def status(self, now_s: float) -> base.ModuleStatus:
        """Ready after the settling time; the module has no periodic status."""
        status = super().status(now_s)
        text = status.text if self._version is None else f"module {self._version}"
        return base.ModuleStatus(status.ready and not self._binding, self._binding, text)
