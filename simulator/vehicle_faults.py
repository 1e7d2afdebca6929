"""Faults of vehicles and their radio modules by a time table; they end by themselves or by `Recover`."""

import heapq
import itertools
import math
from collections.abc import Iterable, Mapping
from typing import Final

from rcopterx.simulator.faults import BreakRadio, BreakVehicle, Fault, FaultError, Recover, TimedFault
from rcopterx.simulator.plant import Plant, PlantFaults, four
from rcopterx.simulator.radio import RadioPty
from rcopterx.simulator.radio_kinds import condition_refused, set_condition

_STICKS: Final = ("pitch", "roll", "thrust", "yaw")


class VehicleFaults:
    """Breaks and repairs the plants and the radio modules of vehicles; other faults are ignored."""

    def __init__(self, plants: Mapping[str, Plant], radios: Mapping[str, RadioPty]) -> None:
        self._plants, self._radios = plants, radios
        self._table: list[tuple[float, int, Fault]] = []
        self._order = itertools.count()
        self._active: dict[tuple[object, ...], tuple[BreakRadio | BreakVehicle, float]] = {}

    @property
    def active(self) -> tuple[BreakRadio | BreakVehicle, ...]:
        """Faults that last now."""
        return tuple(fault for fault, _ in self._active.values())

    def check(self, table: Iterable[TimedFault]) -> None:
        """Raise `FaultError` for a line that cannot be carried out."""
        for line in table:
            fault = line.fault
            if not isinstance(fault, BreakRadio | BreakVehicle):
                continue
            kind = fault.__struct_config__.tag
            if fault.vehicle not in self._plants:
                known = ", ".join(self._plants)
                raise FaultError(f"{kind}: no vehicle {fault.vehicle!r}, there are {known}")
            if isinstance(fault, BreakRadio):
                refusal = condition_refused(self._radios[fault.vehicle], fault.condition)
                if refusal is not None:
                    raise FaultError(f"{kind}: {fault.vehicle}: {refusal}")

    def schedule(self, table: Iterable[TimedFault], start_s: float) -> None:
        """Add the lines for vehicles, which have been checked."""
        for line in table:
            if isinstance(line.fault, BreakRadio | BreakVehicle | Recover):
                heapq.heappush(self._table, (start_s + line.at_s, next(self._order), line.fault))

    def advance(self, now_s: float) -> None:
        """Start and end faults that are due."""
        while self._table and self._table[0][0] <= now_s:
            at_s, _, fault = heapq.heappop(self._table)
            if isinstance(fault, BreakRadio | BreakVehicle):
                ends_s = math.inf if fault.duration_s is None else at_s + fault.duration_s
                self._active[fault.slot] = fault, ends_s
                self._break(fault, now_s)
            else:
                self._active = {slot: (active, now_s) for slot, (active, _) in self._active.items()}
        for slot, (fault, ends_s) in list(self._active.items()):
            if ends_s <= now_s:
                del self._active[slot]
                self._repair(fault, now_s)

    def _break(self, fault: BreakRadio | BreakVehicle, now_s: float) -> None:
        if isinstance(fault, BreakRadio):
            set_condition(self._radios[fault.vehicle], fault.condition, now_s)
            return
        gains = [0.0 if name == fault.dead else -1.0 if name == fault.reversed else 1.0 for name in _STICKS]
        stuck = frozenset(axis for axis, name in enumerate(_STICKS) if name == fault.stuck)
        self._plants[fault.vehicle].faults = PlantFaults(
            stick_gain=four(gains), stuck=stuck, thrust_factor=fault.thrust_factor, trim=fault.trim
        )

    def _repair(self, fault: BreakRadio | BreakVehicle, now_s: float) -> None:
        if isinstance(fault, BreakRadio):
            set_condition(self._radios[fault.vehicle], "ready", now_s)
        else:
            self._plants[fault.vehicle].faults = PlantFaults()
