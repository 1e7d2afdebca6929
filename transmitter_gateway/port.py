"""What a transmitter needs of the way to its radio, whether a serial line, a datagram socket or USB."""

import math
from abc import ABC, abstractmethod
from collections import Counter
from enum import StrEnum
from typing import ClassVar

from msgspec import Struct

from rcopterx.transmitter_gateway.inputs import ArbiterOutput


class WriteOutcome(StrEnum):
    """Outcome of a write."""

    WRITTEN = "frames written"
    CLOSED = "frames not sent: port closed"
    SILENT = "frames not sent: silence after a short write"
    BACKLOG = "frames not sent: earlier bytes still queued"
    SHORT = "short writes"
    FAILED = "failed writes"


class Write(Struct, frozen=True):
    """One attempt to write a frame: outcome, decision behind it, pulse widths in channel order."""

    time_s: float
    outcome: WriteOutcome
    output: ArbiterOutput
    pulses_us: tuple[float, ...]


class Port(ABC):
    """A port that `service` opens and reopens, written frame by frame; it never blocks.

    `problem` is why it is not open; outcomes of writes, openings and losses are counted by name.
    """

    retry_s: ClassVar[float]  # from a loss to the next attempt to open it

    def __init__(self, path: str) -> None:
        self.path = path
        self.problem: str | None = "not opened yet"
        self.counters: Counter[str] = Counter()
        self._next_attempt_s = -math.inf

    @property
    def is_open(self) -> bool:
        """True while frames can be written; False is the state LINK_LOST."""
        return self.problem is None

    @property
    def next_attempt_s(self) -> float:
        """When `service` has something to do again [s]; infinite while open."""
        return math.inf if self.is_open else self._next_attempt_s

    @property
    def overload(self) -> str | None:
        """Why no flight shall begin although the port is open; None if one may."""
        return None

    @abstractmethod
    def fileno(self) -> int | None:
        """File descriptor to wait for answers on, None while closed."""

    @abstractmethod
    def service(self, now_s: float) -> bool:
        """Open the port if it is closed and an attempt is due; return True once, when it is open."""

    def write_frame(self, frame: bytes, now_s: float) -> WriteOutcome:
        """Write one whole frame, or nothing; never wait."""
        outcome = self._write(frame, now_s)
        self.counters[outcome] += 1
        return outcome

    @abstractmethod
    def _write(self, frame: bytes, now_s: float) -> WriteOutcome:
        """Write a frame; its outcome is counted by the caller."""

    def _lose(self, problem: str, now_s: float) -> None:
        """Close at once: a held descriptor makes an adapter come back under another name."""
        if self.is_open:
            self.counters["losses"] += 1
        self.close()
        self.problem = problem
        self._next_attempt_s = now_s + self.retry_s

    @abstractmethod
    def read_available(self, now_s: float) -> bytes:
        """Return the bytes that have arrived, possibly none."""

    @abstractmethod
    def close(self) -> None:
        """Close the port, and discard what is still to be sent; `service` would open it again."""
