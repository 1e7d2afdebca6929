"""Decisions about which work an overloaded agent leaves out."""

from collections import deque
from enum import IntEnum
from typing import Final

LATE_PERIODS: Final = 0.9  # a command that leaves so many control periods after its pose was due is late
WINDOW_S: Final = 1.0
LATE_SHARE: Final = 0.3  # share of late and missed control periods in a window above which work is left out
EASE_AFTER_S: Final = 10.0  # time without overload after which the last work that was left out is done again
LONGEST_EASE_AFTER_S: Final = 160.0  # the time doubles up to this after each relapse


class Relief(IntEnum):
    """Work that is left out; each level includes all before it."""

    NONE = 0
    REPORTS = 1
    """Statuses and intents are published half as often, and inputs of steps not at all: the replay has a gap
    there. For avoidance only the plans of the nearest vehicles are received."""
    HALF_RATE = 2  # every second control period flies the input that was planned for it
    THIRD_RATE = 3  # two of three do
    QUARTER_RATE = 4  # three of four do

    @property
    def every(self) -> int:
        """One of so many control periods is computed."""
        return max(1, self.value)

    @property
    def description(self) -> str:
        """For people; empty for none."""
        rate = f", control at {self.name.lower().replace('_', ' ')}" if self.every > 1 else ""
        return f"fewer statuses, no replay, only the nearest plans received{rate}" if self else ""


def planned_relief(every: int) -> Relief:
    """Return the relief with which one of so many control periods is computed."""
    return Relief.NONE if every == 1 else Relief(min(every, max(Relief)))


class Overload:
    """Decides which work an agent leaves out."""

    def __init__(self, period_s: float) -> None:
        self.relief = self._planned = Relief.NONE
        self._period_s = period_s
        self._late: deque[bool] = deque(maxlen=max(1, round(WINDOW_S / period_s)))
        self._calm_s = 0.0
        self._ease_after_s = EASE_AFTER_S
        self._eased = False

    @property
    def late_share(self) -> float:
        """Share of the last control periods that were late or missed."""
        return sum(self._late) / (self._late.maxlen or 1)

    def observe(self, late_s: float, missed: int) -> bool:
        """Process a period in flight, `late_s` after its pose; return whether `relief` has changed."""
        self._note(late_s, missed)
        self._calm_s += self._period_s * self.relief.every
        if self.late_share > LATE_SHARE:
            return self._leave_out()
        return self._calm_s >= self._ease_after_s and self._do_again()

    def stand(self, late_s: float) -> bool:
        """Process a period on the floor, without further relief; return whether it was more than planned."""
        changed, self.relief = self.relief is not self._planned, self._planned
        self._calm_s, self._ease_after_s, self._eased = 0.0, EASE_AFTER_S, False
        self._note(late_s, 0)
        return changed

    def _note(self, late_s: float, missed: int) -> None:
        # At a lower rate a period counts as often as it is longer.
        every = self.relief.every
        late = late_s > LATE_PERIODS * self._period_s * every
        self._late.extend([True] * (every * missed) + [late] * every)

    def plan(self, relief: Relief) -> None:
        """Leave out at least this from now on, and forget what was observed."""
        self.relief = self._planned = relief
        self._late.clear()
        self._calm_s, self._ease_after_s, self._eased = 0.0, EASE_AFTER_S, False

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
