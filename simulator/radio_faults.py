"""Faults of the emulated radio modules, now or by a time table; they end by themselves or by `Recover`."""

import heapq
import itertools
import math
from collections.abc import Iterable, Mapping

from rcopterx.simulator.faults import BreakRadio, Fault, FaultError, Recover, TimedFault
from rcopterx.simulator.radio import RadioPty
from rcopterx.simulator.radio_kinds import condition_refused, set_condition


class RadioFaults:
    """Breaks and repairs the radio modules of vehicles."""

    def __init__(self, radios: Mapping[str, RadioPty]) -> None:
        self._radios = radios
        self._table: list[tuple[float, int, Fault]] = []
        self._order = itertools.count()
        self._active: dict[str, tuple[BreakRadio, float]] = {}

    @property
    def active(self) -> tuple[BreakRadio, ...]:
        """Faults that last now."""
        return tuple(fault for fault, _ in self._active.values())

    def check(self, table: Iterable[TimedFault]) -> None:
        """Raise `FaultError` for a line that cannot be carried out."""
        for line in table:
            fault = line.fault
            if not isinstance(fault, BreakRadio):
                continue
            if fault.vehicle not in self._radios:
                known = ", ".join(self._radios)
                raise FaultError(f"break_radio: no vehicle {fault.vehicle!r}, there are {known}")
            if fault.duration_s is not None and fault.duration_s < 0:
                raise FaultError(f"duration_s = {fault.duration_s!r}: allowed is zero or more")
            refusal = condition_refused(self._radios[fault.vehicle], fault.condition)
            if refusal is not None:
                raise FaultError(f"break_radio: {fault.vehicle}: {refusal}")

    def schedule(self, table: Iterable[TimedFault], start_s: float) -> None:
        """Take the lines that concern radios; they have been checked."""
        for line in table:
            if isinstance(line.fault, BreakRadio | Recover):
                heapq.heappush(self._table, (start_s + line.at_s, next(self._order), line.fault))

    def advance(self, now_s: float) -> None:
        """Start what the time table says and end what is over."""
        while self._table and self._table[0][0] <= now_s:
            at_s, _, fault = heapq.heappop(self._table)
            if isinstance(fault, BreakRadio):
                ends_s = math.inf if fault.duration_s is None else at_s + fault.duration_s
                self._active[fault.vehicle] = fault, ends_s
                set_condition(self._radios[fault.vehicle], fault.condition, now_s)
            else:
                self._active = {name: (active, now_s) for name, (active, _) in self._active.items()}
        for name in [name for name, (_, ends_s) in self._active.items() if ends_s <= now_s]:
            del self._active[name]
            set_condition(self._radios[name], "ready", now_s)
