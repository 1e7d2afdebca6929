"""Promises about flights with a fault, and checks of what was seen against them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

CHECKED_AT_LEAST: Final = 10  # with fewer recorded states of a vehicle its flight is unknown
OFF: Final = frozenset({"disarmed", "cut", "killed"})  # states of the arbiter without thrust
REASON: Final = "it lands: "  # begins the remark of an agent that lands its vehicle by itself


class Promise(Enum):
    """How a flight with a fault goes on."""

    FLIES_ON = "flies on"
    LANDS = "lands closed loop"
    LANDS_AND_REPORTS = "lands and reports"
    LANDS_OPEN_LOOP = "lands open loop"
    REFUSED = "refused"
    STAYS_DOWN = "stays on the floor"
    UNPROTECTED = "not protected"


@dataclass(frozen=True)
class PromisedLimits:
    """Limits of a flight; None for no limit.

    For vehicles that fly on, the largest distance from their place and the longest time without a fresh
    command; for vehicles that come down, the horizontal distance from their place and the speed; for those
    that stay on the floor, the true height.
    """

    deviation_mm: float | None = 150.0
    drift_mm: float | None = None
    touchdown_m_s: float | None = None
    silence_ms: float | None = 600.0
    height_m: float | None = None


LIMITS: Final = {
    Promise.FLIES_ON: PromisedLimits(),
    Promise.LANDS: PromisedLimits(deviation_mm=None, drift_mm=300.0, touchdown_m_s=0.6, silence_ms=None),
    # It drifts before it lands, and while it does.
    Promise.LANDS_AND_REPORTS: PromisedLimits(None, drift_mm=800.0, touchdown_m_s=0.6, silence_ms=None),
    Promise.LANDS_OPEN_LOOP: PromisedLimits(deviation_mm=None, touchdown_m_s=1.7, silence_ms=None),
    Promise.STAYS_DOWN: PromisedLimits(None, touchdown_m_s=1.0, silence_ms=None, height_m=0.15),
    Promise.REFUSED: PromisedLimits(deviation_mm=None, silence_ms=None),
    Promise.UNPROTECTED: PromisedLimits(deviation_mm=None, silence_ms=None),
}
"""Limits of rows without their own."""


@dataclass(frozen=True)
class SeenFlight:
    """Figures of one vehicle, from its true states (their number is `states`) and its radio.

    Distances count from its place at the beginning. `drift_mm` and `touchdown_m_s`, the speed of its hardest
    touchdown, are None before it has touched the floor, `silence_ms` before its second fresh command.
    `remarks` are those of its agent.
    """

    states: int
    deviation_mm: float
    drift_mm: float | None
    touchdown_m_s: float | None
    silence_ms: float | None
    states_of_arbiter: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    highest_m: float = 0.0
    ended: str = ""  # last state of its arbiter

    @property
    def down(self) -> bool:
        """Whether it has touched the floor."""
        return self.touchdown_m_s is not None


Check = dict[str, Any]


def judged(
    promise: Promise,
    down: tuple[str, ...],
    limits: PromisedLimits,
    seen: Mapping[str, SeenFlight],
    broken: Sequence[str] = (),
) -> list[Check]:
    """Checks of a flight (`name`, `passed`, `figure`); only the vehicles `down` may come down.

    `broken` are the promises of every flight that this one breaks.
    """
    flown = {name: vehicle for name, vehicle in seen.items() if name not in down}
    landed = {name: vehicle for name, vehicle in seen.items() if name in down}
    blind = [name for name, vehicle in seen.items() if vehicle.states < CHECKED_AT_LEAST]
    checks = [
        _check("the true states of all vehicles are known", not blind, blind),
        _check("the promises of every flight hold", not broken, list(broken)),
    ]
    if promise is not Promise.REFUSED:
        fallen = [name for name, vehicle in flown.items() if vehicle.down]
        checks.append(_check("no other vehicle comes down", not fallen, fallen))
    if landed:
        left = [name for name, vehicle in landed.items() if not vehicle.down]
        checks.append(_check(f"{', '.join(landed)} comes down", not left, left))
    if promise is Promise.LANDS_AND_REPORTS:
        remarks = {name: vehicle.remarks for name, vehicle in landed.items()}
        reported = all(any(text.startswith(REASON) for text in texts) for texts in remarks.values())
        checks.append(_check("why it lands is reported", reported, remarks))
    for limit, what, unit, concerned in (
        (limits.deviation_mm, "deviation_mm", "mm from its place", flown),
        (limits.silence_ms, "silence_ms", "ms without a fresh command", flown),
        (limits.drift_mm, "drift_mm", "mm from its place at touchdown", landed),
        (limits.touchdown_m_s, "touchdown_m_s", "m/s at touchdown", landed),
    ):
        if limit is None or not concerned:
            continue
        figures = {name: getattr(vehicle, what) for name, vehicle in concerned.items()}
        good = all(figure is not None and figure <= limit for figure in figures.values())
        checks.append(_check(f"at most {limit:g} {unit}", good, figures))
    return checks


def judged_take_off(
    seen: Mapping[str, SeenFlight],
    limits: PromisedLimits,
    cause: str,
    reported: Sequence[str],
    broken: Sequence[str] = (),
) -> list[Check]:
    """Checks of a take-off that a fault ends: nothing rises, and a line names the cause.

    `cause`: pattern of such lines. `reported`: all lines that users see. `broken`: as in `judged`.
    """
    blind = [name for name, vehicle in seen.items() if vehicle.states < CHECKED_AT_LEAST]
    heights = {name: vehicle.highest_m for name, vehicle in seen.items()}
    speeds = {name: vehicle.touchdown_m_s or 0.0 for name, vehicle in seen.items()}
    ended = {name: vehicle.ended for name, vehicle in seen.items()}
    return [
        _check("the true states of all vehicles are known", not blind, blind),
        _check("the promises of every flight hold", not broken, list(broken)),
        _check(f"at most {limits.height_m:g} m high", _within(heights, limits.height_m), heights),
        _check(
            f"at most {limits.touchdown_m_s:g} m/s at touchdown",
            _within(speeds, limits.touchdown_m_s),
            speeds,
        ),
        _check("the motors are off", set(ended.values()) <= OFF, ended),
        _check("the cause is named", any(re.search(cause, line) for line in reported), list(reported)),
    ]


def _within(figures: Mapping[str, float], limit: float | None) -> bool:
    return limit is None or max(figures.values()) <= limit


def _check(name: str, passed: bool, figure: object) -> Check:
    return {"name": name, "passed": passed, "figure": figure}


def outcome(promise: Promise, seen: Mapping[str, SeenFlight]) -> str:
    """Describe a flight in words."""
    fallen = [name for name, vehicle in seen.items() if vehicle.down]
    if promise is Promise.STAYS_DOWN:
        return f"at most {max(vehicle.highest_m for vehicle in seen.values()):.2f} m high"
    if promise is Promise.REFUSED or not fallen:
        return promise.value if promise in (Promise.REFUSED, Promise.FLIES_ON) else "all fly on"
    closed = all("land" in seen[name].states_of_arbiter[-3:] for name in fallen)
    how = "down after LAND" if closed else "down"
    others = "" if len(fallen) == len(seen) else ", the others fly on"
    return f"{', '.join(fallen)} {how}{others}"
