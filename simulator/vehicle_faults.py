"""Faults of the simulated vehicles."""

from collections.abc import Mapping
from typing import Final

from rcopterx.simulator.fault_table import FaultTable
from rcopterx.simulator.faults import BreakVehicle
from rcopterx.simulator.plant import Plant, PlantFaults, four

_STICKS: Final = ("pitch", "roll", "thrust", "yaw")


class VehicleFaults(FaultTable[BreakVehicle, Plant]):
    """Breaks and repairs plants of vehicles."""

    def __init__(self, plants: Mapping[str, Plant]) -> None:
        super().__init__(BreakVehicle, "break_vehicle", plants)

    def _break(self, part: Plant, fault: BreakVehicle, now_s: float) -> None:  # noqa: ARG002 - at once
        gains = [0.0 if name == fault.dead else -1.0 if name == fault.reversed else 1.0 for name in _STICKS]
        stuck = frozenset(axis for axis, name in enumerate(_STICKS) if name == fault.stuck)
        part.faults = PlantFaults(
            stick_gain=four(gains), stuck=stuck, thrust_factor=fault.thrust_factor, trim=fault.trim
        )

    def _repair(self, part: Plant, now_s: float) -> None:  # noqa: ARG002 - at once
        part.faults = PlantFaults()
