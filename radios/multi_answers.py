"""Answers of a Multiprotocol module (DIY-Multiprotocol-TX-Module): incremental TLV parser."""

from dataclasses import dataclass

from rcopterx.radios.multi_radios import RADIOS
from rcopterx.radios.protocol import ModuleStatus

SYNC = b"MP"
LONGEST_PAYLOAD = 40
STATUS, STATUS_LENGTH = 0x01, 24

INPUT_PRESENT = 0x01
SERIAL_MODE = 0x02
PROTOCOL_VALID = 0x04
BINDING = 0x08

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

    @staticmethod
    def of(payload: bytes) -> "MultiStatus":
        """Read a payload of at least `STATUS_LENGTH` bytes."""
        version = (payload[1], payload[2], payload[3], payload[4])
        protocol, sub_protocol = _text(payload[8:15]), _text(payload[16:24])
        return MultiStatus(payload[0], version, _order(payload[5]), protocol, sub_protocol)

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
    def binding(self) -> bool:
        """True while the module sends bind packets or listens for the receiver's answer."""
        return bool(self.flags & BINDING)

    def _problem(self, radio: str) -> str | None:
        if not self.flags & SERIAL_MODE:
            return "is not in serial mode: set its dial to 0"
        if not self.has_input:
            return "receives no valid frames"
        # EU builds report a valid protocol in the first 0.5 s after each initialisation; only the name of its
        # sub-protocol shows that it will be refused.
        if not self.flags & PROTOCOL_VALID or self.sub_protocol.startswith(REFUSED_NAME):
            return f"refuses the protocol {radio} (EU builds refuse DSM2)"
        if self.protocol != radio:
            return f"runs protocol {self.protocol!r}, not {radio}"
        if not RADIOS[radio].taer and self.order != LINE_ORDER:
            return f"expects channels in the order {self.order}: flash a build for {LINE_ORDER}"
        return "binding" if self.binding else None


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("ascii", "replace")


def _order(code: int) -> str:
    letters = ["?"] * 4
    for function, shift in (("A", 0), ("E", 2), ("T", 4), ("R", 6)):
        letters[code >> shift & 0x03] = function
    return "".join(letters)


class AnswerParser:
    """Finds status answers in a byte stream that may be cut anywhere and may contain anything else."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[MultiStatus]:
        """Take bytes and return the status answers completed by them."""
        self._buffer += data
        found: list[MultiStatus] = []
        while (answer := self._next_answer()) is not None:
            kind, payload = answer
            if kind == STATUS and len(payload) >= STATUS_LENGTH:
                found.append(MultiStatus.of(payload))
        return found

    def _next_answer(self) -> tuple[int, bytes] | None:
        """Remove the next answer of any type; return its type and payload, None before it is complete."""
        buffer = self._buffer
        while True:
            start = buffer.find(SYNC)
            if start < 0:
                # The last byte may be the first half of a sync mark.
                start = len(buffer) - buffer.endswith(SYNC[:1])
            del buffer[:start]
            if len(buffer) < 4:
                return None
            end = 4 + buffer[3]
            if end > 4 + LONGEST_PAYLOAD:
                del buffer[:1]
            elif len(buffer) < end:
                return None
            else:
                answer = buffer[2], bytes(buffer[4:end])
                del buffer[:end]
                return answer
