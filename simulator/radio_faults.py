"""Faults of the emulated radio modules."""

from collections.abc import Mapping

from rcopterx.simulator.fault_table import FaultTable
from rcopterx.simulator.faults import BreakRadio
from rcopterx.simulator.radio import RadioPty
from rcopterx.simulator.radio_kinds import condition_refused, set_condition


class RadioFaults(FaultTable[BreakRadio, RadioPty]):
    """Breaks and repairs the radio modules of vehicles."""

    def __init__(self, radios: Mapping[str, RadioPty]) -> None:
        super().__init__(BreakRadio, "break_radio", radios)

    def _refusal(self, fault: BreakRadio) -> str | None:
        return condition_refused(self._parts[fault.vehicle], fault.condition)

    def _break(self, part: RadioPty, fault: BreakRadio, now_s: float) -> None:
        set_condition(part, fault.condition, now_s)

    def _repair(self, part: RadioPty, now_s: float) -> None:
        set_condition(part, "ready", now_s)
