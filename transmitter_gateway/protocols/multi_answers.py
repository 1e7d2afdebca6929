"""Answers of a Multiprotocol module (DIY-Multiprotocol-TX-Module): incremental TLV parser."""

from __future__ import annotations

from dataclasses import dataclass

from rcopterx.transmitter_gateway.protocols.base import ModuleStatus
from rcopterx.transmitter_gateway.protocols.multi_radios import RADIOS

SYNC = b"MP"
LONGEST_PAYLOAD = 40

INPUT_PRESENT = 0x01
SERIAL_MODE = 0x02
PROTOCOL_VALID = 0x04
BINDING = 0x08
WAITING_FOR_BIND = 0x10

REFUSED_NAME = "--"
LINE_ORDER = "AETR"


@dataclass(frozen=True, slots=True)
class MultiStatus:
    """Status answer: flags, firmware version, channel order (such as "AETR"), protocol names."""

    flags: int
    version: tuple[int, int, int, int]
    order: str
    protocol: str
    sub_protocol: str

    def judged(self, radio: str) -> ModuleStatus:
        """State of a module that is to transmit with a protocol of `RADIOS`."""
        problem = self._problem(radio)
        version = ".".join(str(part) for part in self.version)
        ready = f"ready, {self.protocol} {self.sub_protocol}".rstrip()
        return ModuleStatus(problem is None, self.binding, f"module {version} {problem or ready}")

    @property
    def has_input(self) -> bool:
        """True when the module receives frames."""
        return bool(self.flags & INPUT_PRESENT)

    @property
    def refuses(self) -> bool:
        """True when the build does not have the protocol.

        EU builds report a valid protocol in the first 0.5 s after each initialisation; only the name of its
        sub-protocol shows that it will be refused.
        """
        return not self.flags & PROTOCOL_VALID or self.sub_protocol.startswith(REFUSED_NAME)

    @property
    def binding(self) -> bool:
        """True while the module sends bind packets or listens for the receiver's answer."""
        return bool(self.flags & BINDING)

    def _problem(self, radio: str) -> str | None:
        if not self.flags & SERIAL_MODE:
            return "is not in serial mode: set its dial to 0"
        if not self.has_input:
            return "receives no valid frames"
        if self.refuses:
            return f"refuses the protocol {radio} (EU builds refuse DSM2)"
        if self.protocol != radio:
            return f"runs protocol {self.protocol!r}, not {radio}"
        if not RADIOS[radio].taer and self.order != LINE_ORDER:
            return f"expects channels in the order {self.order}: flash a build for {LINE_ORDER}"
        return "binding" if self.binding else None


@dataclass(frozen=True, slots=True)
class MultiBindAnswer:
    """Bind answer of the receiver: its identity, version, number of channels, radio type."""

    identity: bytes
    version: int
    channels: int
    radio_type: int


@dataclass(frozen=True, slots=True)
class MultiTelemetry:
    """Telemetry frame relayed from the receiver with its signal strength."""

    signal_strength: int
    frame: bytes


@dataclass(frozen=True, slots=True)
class MultiInputSync:
    """How the module wants the frames timed: period and lateness [us]."""

    period_us: int
    lateness_us: int


MultiAnswer = MultiStatus | MultiBindAnswer | MultiTelemetry | MultiInputSync


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("ascii", "replace")


def _order(code: int) -> str:
    letters = ["?"] * 4
    for function, shift in (("A", 0), ("E", 2), ("T", 4), ("R", 6)):
        letters[code >> shift & 0x03] = function
    return "".join(letters)


def _interpret(kind: int, payload: bytes) -> MultiAnswer | None:
    if kind == 0x01 and len(payload) >= 24:
        version = (payload[1], payload[2], payload[3], payload[4])
        return MultiStatus(
            payload[0], version, _order(payload[5]), _text(payload[8:15]), _text(payload[16:24])
        )
    if kind == 0x04 and len(payload) >= 17:
        return MultiTelemetry(payload[0], payload[1:17])
    if kind == 0x05 and len(payload) >= 10:
        return MultiBindAnswer(bytes(byte ^ 0xFF for byte in payload[:4]), payload[4], payload[5], payload[6])
    if kind == 0x08 and len(payload) >= 4:
        return MultiInputSync(int.from_bytes(payload[0:2], "big"), int.from_bytes(payload[2:4], "big"))
    return None


class AnswerParser:
    """Finds answers in a byte stream that may be cut anywhere and may contain garbage.

    It counts bytes that belonged to no answer, and answers of an unknown type or too short for their type.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.skipped_bytes = 0
        self.unknown_answers = 0

    def feed(self, data: bytes) -> list[MultiAnswer]:
        """Take bytes and return the answers completed by them."""
        self._buffer += data
        answers: list[MultiAnswer] = []
        while (frame := self._next_frame()) is not None:
            answer = _interpret(*frame)
            if answer is None:
                self.unknown_answers += 1
            else:
                answers.append(answer)
        return answers

    def _next_frame(self) -> tuple[int, bytes] | None:
        while True:
            self._hunt()
            if len(self._buffer) < 4:
                return None
            length = self._buffer[3]
            if length > LONGEST_PAYLOAD:
                self._skip(1)
                continue
            if len(self._buffer) < 4 + length:
                return None
            frame = (self._buffer[2], bytes(self._buffer[4 : 4 + length]))
            del self._buffer[: 4 + length]
            return frame

    def _hunt(self) -> None:
        start = self._buffer.find(SYNC)
        if start < 0:
            # The last byte may be the first half of a sync mark.
            keep = 1 if self._buffer[-1:] == SYNC[:1] else 0
            start = len(self._buffer) - keep
        if start:
            self._skip(start)

    def _skip(self, count: int) -> None:
        self.skipped_bytes += count
        del self._buffer[:count]
