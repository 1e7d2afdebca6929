"""Faults of the simulated vehicles, now or by a time table; they end by themselves or by `Recover`."""

import heapq
import itertools
import math
from collections.abc import Iterable, Mapping
from typing import Final

from rcopterx.simulator.faults import BreakVehicle, Fault, FaultError, Recover, TimedFault
from rcopterx.simulator.plant import Plant, PlantFaults, four

_STICKS: Final = ("pitch", "roll", "thrust", "yaw")


class VehicleFaults:
    """Breaks and repairs plants of vehicles."""

    def __init__(self, plants: Mapping[str, Plant]) -> None:
        self._plants = plants
        self._table: list[tuple[float, int, Fault]] = []
        self._order = itertools.count()
        self._active: dict[str, tuple[BreakVehicle, float]] = {}

    @property
    def active(self) -> tuple[BreakVehicle, ...]:
        """Faults that last now."""
        return tuple(fault for fault, _ in self._active.values())

    def check(self, table: Iterable[TimedFault]) -> None:
        """Raise `FaultError` for a line that cannot be carried out."""
        for line in table:
            fault = line.fault
            if not isinstance(fault, BreakVehicle):
                continue
            if fault.vehicle not in self._plants:
                known = ", ".join(self._plants)
                raise FaultError(f"break_vehicle: no vehicle {fault.vehicle!r}, there are {known}")
            if fault.duration_s is not None and fault.duration_s < 0:
                raise FaultError(f"duration_s = {fault.duration_s!r}: allowed is zero or more")

    def schedule(self, table: Iterable[TimedFault], start_s: float) -> None:
        """Take the lines that concern vehicles; they have been checked."""
        for line in table:
            if isinstance(line.fault, BreakVehicle | Recover):
                heapq.heappush(self._table, (start_s + line.at_s, next(self._order), line.fault))

    def advance(self, now_s: float) -> None:
        """Start what the time table says and end what is over."""
        while self._table and self._table[0][0] <= now_s:
            at_s, _, fault = heapq.heappop(self._table)
            if isinstance(fault, BreakVehicle):
                ends_s = math.inf if fault.duration_s is None else at_s + fault.duration_s
                self._active[fault.vehicle] = fault, ends_s
                self._plants[fault.vehicle].faults = plant_faults(fault)
            else:
                self._active = {name: (active, now_s) for name, (active, _) in self._active.items()}
        for name in [name for name, (_, ends_s) in self._active.items() if ends_s <= now_s]:
            del self._active[name]
            self._plants[name].faults = PlantFaults()


def plant_faults(fault: BreakVehicle) -> PlantFaults:
    """What a request breaks about a plant."""
    gains = [0.0 if name == fault.dead else -1.0 if name == fault.reversed else 1.0 for name in _STICKS]
    stuck = frozenset(axis for axis, name in enumerate(_STICKS) if name == fault.stuck)
    return PlantFaults(
        stick_gain=four(gains), stuck=stuck, thrust_factor=fault.thrust_factor, trim=fault.trim
    )
