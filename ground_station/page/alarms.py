"""Alarms of the page: causes in words with a remedy, one line for all vehicles that share a cause."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from msgspec import Struct

from rcopterx.ground_station.page.sentences import Level, taken_over
from rcopterx.ground_station.quantities import battery_low, voltage
from rcopterx.ground_station.scripting.state import VehicleState
from rcopterx.tables import table_beside

GONE_S: Final = 10.0  # how long an alarm stays after its cause has ended
UNSEEN_S: Final = 0.2  # time without a pose in flight from which it is an alarm
SLOW: Final = "this computer is too slow for its fleet"
_SLOW: Final = re.compile(rf"{SLOW}|more agents run on this computer|: a call took longer than \d+ ms")
_NUMBERS: Final = re.compile(r"[\d.█░]+")
CHARGE: Final = "land it, and charge its battery"
_SLOW_REMEDY: Final = (
    "end other programs, fly fewer vehicles or shorten horizons; rcopterx doctor measures it"
)
_REMEDIES: Final = table_beside(__file__, "alarms")
"""What to do, by what the arbiter's state and reason contain; the first one counts."""


@dataclass(frozen=True)
class Cause:
    """Why a vehicle, or the whole fleet, needs attention; causes with the same text share a line."""

    text: str
    level: Level
    remedy: str = ""
    vehicle: str = ""


class Alarm(Struct):
    """A line about a cause; `over` for some seconds after it has ended."""

    text: str
    level: Level
    remedy: str
    seen_s: float = 0.0
    vehicles: list[str] = []
    count: int = 0
    over: bool = True


def causes_of(state: VehicleState) -> Iterator[Cause]:
    """Yield what needs attention at a vehicle."""
    name, agent = state.name, state.agent
    if state.alarming:
        yield _of_arbiter(state)
    if state.airborne and state.silent:
        remedy = "another process takes over, or its transmitter gateway lands it"
        yield Cause("its agent does not report", "red", remedy, name)
    if state.airborne and state.seen_age_s is not None and state.seen_age_s > UNSEEN_S and not state.silent:
        yield Cause("the motion capture does not see it", "amber", "uncover its markers", name)
    if state.airborne and battery_low(state):
        yield Cause(f"low voltage: {voltage(state)}", "amber", CHARGE, name)
    if agent is None:
        return
    if agent.following_mode != "follow":
        mode = agent.following_mode.replace("_", " ")
        yield Cause(f"its leader is lost: {mode}", "amber", "choose another leader, or land it", name)
    yield from (_of_remark(remark, name) for remark in agent.diagnostics.remarks)


def _of_arbiter(state: VehicleState) -> Cause:
    """Cause of a vehicle that its transmitter gateway flies, or whose motors it has cut."""
    words, known = taken_over(state), f"{state.transmitter_state}: {state.reason}"
    remedy = next((what for key, what in _REMEDIES.items() if key in known), "")
    reason = state.reason.removeprefix("landed: ")  # as the words say
    return Cause(f"{words.text}: {reason}", words.level, remedy, state.name)


def _of_remark(remark: str, name: str) -> Cause:
    if _SLOW.search(remark):
        return Cause(SLOW, "amber", _SLOW_REMEDY)
    if remark.startswith("it lands"):
        return Cause(remark, "red", "wait until it has landed", name)
    return Cause(remark, "amber", CHARGE if "battery" in remark else "", name)


class AlarmBoard:
    """Alarms over time: coalesced by cause, counted, gone `GONE_S` after their cause."""

    def __init__(self) -> None:
        self._alarms: dict[str, Alarm] = {}  # by text without numbers, which change

    def update(self, now_s: float, causes: Iterable[Cause]) -> Sequence[Alarm]:
        """Return the alarms at a time: present ones first, red before amber, then by age."""
        before = {key for key, alarm in self._alarms.items() if not alarm.over}
        for alarm in self._alarms.values():
            alarm.over = True
        for cause in causes:
            key = _NUMBERS.sub("", cause.text)
            alarm = self._alarms.setdefault(key, Alarm(cause.text, cause.level, cause.remedy))
            if alarm.over:
                alarm.count += key not in before
                alarm.vehicles, alarm.over, alarm.seen_s = [], False, now_s
            if cause.vehicle and cause.vehicle not in alarm.vehicles:
                alarm.vehicles.append(cause.vehicle)
            alarm.text, alarm.level, alarm.remedy = cause.text, cause.level, cause.remedy
        self._alarms = {key: one for key, one in self._alarms.items() if now_s - one.seen_s <= GONE_S}
        return sorted(self._alarms.values(), key=lambda one: (one.over, one.level != "red"))
