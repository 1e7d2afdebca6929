"""Work that an agent leaves out while its computer cannot keep up, in order.

Poses, commands and the arbiter are never left out. The horizon stays, too: half the stages save a tenth of a
control step. No bus, no clock, no logging.
"""

from collections import deque
from enum import IntEnum
from typing import Final

LATE_PERIODS: Final = 0.9
"""A command that leaves so many control periods after its pose arrived is late."""
WINDOW_S: Final = 1.0
LATE_SHARE: Final = 0.3
"""Share of late and missed control periods in a window above which work is left out."""
HALF_RATE_SERVES: Final = 1.3
"""Vehicles that a computer flies at half rate, over those at full rate."""
EASE_AFTER_S: Final = 10.0
"""Time without overload after which the last work that was left out is done again."""
LONGEST_EASE_AFTER_S: Final = 160.0
"""The time doubles up to this each time when work that was done again had to be left out at once."""


class Relief(IntEnum):
    """Work that is left out; each level includes all before it."""

    NONE = 0
    STATUSES = 1
    """Statuses and intents are published half as often."""
    TELEMETRY = 2
    """The inputs of steps are not published: the replay has a gap there."""
    FAR_PLANS = 3
    """Only the plans of the nearest vehicles are received for avoidance."""
    HALF_RATE = 4
    """Every second control period flies the input that was planned for it."""
    QUARTER_RATE = 5
    """Three of four do."""

    @property
    def every(self) -> int:
        """One of so many control periods is computed."""
        return _EVERY.get(self, 1)

    @property
    def description(self) -> str:
        """For people; empty for none."""
        return _DESCRIPTIONS[self]


_EVERY: Final = {Relief.HALF_RATE: 2, Relief.QUARTER_RATE: 4}
_DESCRIPTIONS: Final = {
    Relief.NONE: "",
    Relief.STATUSES: "fewer statuses",
    Relief.TELEMETRY: "fewer statuses, no replay",
    Relief.FAR_PLANS: "fewer statuses, no replay, only the nearest plans heard",
    Relief.HALF_RATE: "fewer statuses, no replay, only the nearest plans heard, control at half rate",
    Relief.QUARTER_RATE: "fewer statuses, no replay, only the nearest plans heard, control at quarter rate",
}


def planned_relief(crowding: float) -> Relief:
    """Return the relief from take-off on, by the agents per vehicle that the computer can fly."""
    if crowding <= 1.0:
        return Relief.NONE
    return Relief.HALF_RATE if crowding <= HALF_RATE_SERVES else Relief.QUARTER_RATE


class Overload:
    """Decides which work an agent leaves out."""

    def __init__(self, period_s: float) -> None:
        self.relief = self._planned = Relief.NONE
        self._period_s = period_s
        self._late: deque[bool] = deque(maxlen=max(1, round(WINDOW_S / period_s)))
        self._calm_s = 0.0
        self._ease_after_s = EASE_AFTER_S
        self._eased = False

    def observe(self, late_s: float, missed: int) -> bool:
        """Process a control period; return whether `relief` has changed, by one level.

        `late_s` is the time from the arrival of its pose to its command; `missed` periods before it had
        something to compute.
        """
        period_s = self._period_s * self.relief.every
        if missed:
            self._late.extend([True] * missed)
        self._late.append(late_s > LATE_PERIODS * period_s)
        self._calm_s += period_s
        if sum(self._late) > LATE_SHARE * (self._late.maxlen or 1):
            return self._leave_out()
        return self._calm_s >= self._ease_after_s and self._do_again()

    def plan(self, relief: Relief) -> None:
        """Leave out at least this from now on, and forget what was observed."""
        self._planned = relief
        self.forget()

    def forget(self) -> bool:
        """Leave out no more than is planned, as the vehicle does not fly; return whether it was more."""
        changed, self.relief = self.relief is not self._planned, self._planned
        self._late.clear()
        self._calm_s, self._ease_after_s, self._eased = 0.0, EASE_AFTER_S, False
        return changed

    def _leave_out(self) -> bool:
        if self._eased:
            self._ease_after_s = min(2 * self._ease_after_s, LONGEST_EASE_AFTER_S)
        self._late.clear()
        self._calm_s, self._eased = 0.0, False
        if self.relief is Relief.QUARTER_RATE:
            return False
        self.relief = Relief(self.relief + 1)
        return True

    def _do_again(self) -> bool:
        # A long calm after work was done again confirms that decision.
        if self.relief is self._planned:
            self._ease_after_s, self._calm_s, self._eased = EASE_AFTER_S, 0.0, False
            return False
        self._late.clear()
        self._calm_s, self._eased = 0.0, True
        self.relief = Relief(self.relief - 1)
        return True
