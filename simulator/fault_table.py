"""Faults of vehicles and their radios by a time table; they end by themselves or by `Recover`."""

import heapq
import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import Generic, TypeVar

from rcopterx.simulator.faults import Fault, FaultError, Recover, TimedFault, VehicleFault

F = TypeVar("F", bound=VehicleFault)
P = TypeVar("P")


class FaultTable(ABC, Generic[F, P]):
    """Breaks and repairs parts of vehicles.

    Parameters
    ----------
    kind, name
        Faults of this table, others are ignored, and their name in requests.
    parts
        The part of each vehicle.
    """

    def __init__(self, kind: type[F], name: str, parts: Mapping[str, P]) -> None:
        self._kind, self._name = kind, name
        self._parts = parts
        self._table: list[tuple[float, int, Fault]] = []
        self._order = itertools.count()
        self._active: dict[str, tuple[F, float]] = {}

    @property
    def active(self) -> tuple[F, ...]:
        """Faults that last now."""
        return tuple(fault for fault, _ in self._active.values())

    def check(self, table: Iterable[TimedFault]) -> None:
        """Raise `FaultError` for a line that cannot be carried out."""
        for line in table:
            fault = line.fault
            if not isinstance(fault, self._kind):
                continue
            if fault.vehicle not in self._parts:
                known = ", ".join(self._parts)
                raise FaultError(f"{self._name}: no vehicle {fault.vehicle!r}, there are {known}")
            if fault.duration_s is not None and fault.duration_s < 0:
                raise FaultError(f"duration_s = {fault.duration_s!r}: allowed is zero or more")
            refusal = self._refusal(fault)
            if refusal is not None:
                raise FaultError(f"{self._name}: {fault.vehicle}: {refusal}")

    def schedule(self, table: Iterable[TimedFault], start_s: float) -> None:
        """Add the lines of this kind, which have been checked."""
        for line in table:
            if isinstance(line.fault, self._kind | Recover):
                heapq.heappush(self._table, (start_s + line.at_s, next(self._order), line.fault))

    def advance(self, now_s: float) -> None:
        """Start and end faults that are due."""
        while self._table and self._table[0][0] <= now_s:
            at_s, _, fault = heapq.heappop(self._table)
            if isinstance(fault, self._kind):
                ends_s = math.inf if fault.duration_s is None else at_s + fault.duration_s
                self._active[fault.vehicle] = fault, ends_s
                self._break(self._parts[fault.vehicle], fault, now_s)
            else:
                self._active = {name: (active, now_s) for name, (active, _) in self._active.items()}
        for name in [name for name, (_, ends_s) in self._active.items() if ends_s <= now_s]:
            del self._active[name]
            self._repair(self._parts[name], now_s)

    def _refusal(self, fault: F) -> str | None:  # noqa: ARG002 - most parts refuse nothing
        return None

    @abstractmethod
    def _break(self, part: P, fault: F, now_s: float) -> None: ...

    @abstractmethod
    def _repair(self, part: P, now_s: float) -> None: ...
