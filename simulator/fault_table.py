"""Faults by a time table, and those that last now."""

import heapq
import itertools
import math
from collections.abc import Iterator
from typing import Generic, NamedTuple, TypeVar

from rcopterx.simulator.faults import LastingFault

L = TypeVar("L")
F = TypeVar("F", bound=LastingFault)


class Lasting(NamedTuple, Generic[F]):
    """A fault that lasts; without an end of its own until `Recover`."""

    fault: F
    started_s: float
    ends_s: float


class FaultTable(Generic[L, F]):
    """Faults L that begin later, and those F of them that have begun and last, by their slots."""

    def __init__(self) -> None:
        self._lines: list[tuple[float, int, L]] = []
        self._order = itertools.count()
        self.lasting: dict[tuple[object, ...], Lasting[F]] = {}

    def add(self, at_s: float, fault: L) -> None:
        """Add a fault that begins at a time."""
        heapq.heappush(self._lines, (at_s, next(self._order), fault))

    def due(self, now_s: float) -> Iterator[tuple[float, L]]:
        """Remove the faults that are due, and yield their times and them."""
        while self._lines and self._lines[0][0] <= now_s:
            at_s, _, fault = heapq.heappop(self._lines)
            yield at_s, fault

    def begin(self, fault: F, at_s: float) -> None:
        """Note that a fault lasts from a time on."""
        ends_s = math.inf if fault.duration_s is None else at_s + fault.duration_s
        self.lasting[fault.slot] = Lasting(fault, at_s, ends_s)

    def end(self, by_s: float = math.inf) -> list[F]:
        """Remove and return the lasting faults whose time is over, by default all."""
        over = [slot for slot, entry in self.lasting.items() if entry.ends_s <= by_s]
        return [self.lasting.pop(slot).fault for slot in over]

    def next_change_s(self) -> float:
        """Return when a fault begins or ends next, infinite for never."""
        times = [entry.ends_s for entry in self.lasting.values()] + [line[0] for line in self._lines[:1]]
        return min(times, default=math.inf)
