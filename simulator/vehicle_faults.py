"""Faults of vehicles and their radio modules by a time table; they end by themselves or by `Recover`."""

from collections.abc import Iterable, Mapping
from typing import Final

from rcopterx.simulator.faults import BreakRadio, BreakVehicle, FaultError, FaultTable, Recover, TimedFault
from rcopterx.simulator.plant import Plant, PlantFaults, four
from rcopterx.simulator.radio_kinds import condition_refused, set_condition
from rcopterx.simulator.radio_module import RadioEnd
from rcopterx.vehicles.state import U_PITCH, U_ROLL

_STICKS: Final = ("pitch", "roll", "thrust", "yaw")


class VehicleFaults:
    """Breaks and repairs the plants and the radio modules of vehicles; other faults are ignored."""

    def __init__(self, plants: Mapping[str, Plant], radios: Mapping[str, RadioEnd]) -> None:
        self._plants, self._radios = plants, radios
        self.table: FaultTable[BreakRadio | BreakVehicle | Recover, BreakRadio | BreakVehicle] = FaultTable()

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
            else:
                refusal = _tilt_refused(fault, self._plants[fault.vehicle].keeps_attitude)
            if refusal is not None:
                raise FaultError(f"{kind}: {fault.vehicle}: {refusal}")

    def schedule(self, table: Iterable[TimedFault], start_s: float) -> None:
        """Add the lines for vehicles, which have been checked."""
        for line in table:
            if isinstance(line.fault, BreakRadio | BreakVehicle | Recover):
                self.table.add(start_s + line.at_s, line.fault)

    def advance(self, now_s: float) -> None:
        """Start and end faults that are due."""
        for at_s, fault in self.table.due(now_s):
            if isinstance(fault, BreakRadio | BreakVehicle):
                self.table.begin(fault, at_s)
                self._break(fault, now_s)
            else:
                self._repair(self.table.end(), now_s)
        self._repair(self.table.end(now_s), now_s)

    def _break(self, fault: BreakRadio | BreakVehicle, now_s: float) -> None:
        if isinstance(fault, BreakRadio):
            set_condition(self._radios[fault.vehicle], fault.condition, now_s)
            return
        gains = [0.0 if name == fault.dead else -1.0 if name == fault.reversed else 1.0 for name in _STICKS]
        gains[U_PITCH] *= fault.cyclic_factor
        gains[U_ROLL] *= fault.cyclic_factor
        stuck = frozenset(axis for axis, name in enumerate(_STICKS) if name == fault.stuck)
        self._plants[fault.vehicle].faults = PlantFaults(
            stick_gain=four(gains),
            exchanged=fault.exchanged,
            stuck=stuck,
            thrust_factor=fault.thrust_factor,
            trim=fault.trim,
            delay_s=fault.delay_s,
            attitude_gain=fault.attitude_gain,
        )

    def _repair(self, faults: Iterable[BreakRadio | BreakVehicle], now_s: float) -> None:
        for fault in faults:
            if isinstance(fault, BreakRadio):
                set_condition(self._radios[fault.vehicle], "ready", now_s)
            else:
                self._plants[fault.vehicle].faults = PlantFaults()


def _tilt_refused(fault: BreakVehicle, keeps_attitude: bool) -> str | None:
    """Why a vehicle cannot have a fault of its tilt: that is the one of a swash plate, or of a firmware."""
    if keeps_attitude and fault.cyclic_factor != 1.0:
        return "its firmware keeps the attitude, and no swash plate acts more strongly"
    return None if keeps_attitude or fault.attitude_gain == 1.0 else "it has no attitude loop"
