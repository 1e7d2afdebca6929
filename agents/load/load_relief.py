"""Relief of an overloaded agent: it leaves out work, from a step on that a replay can repeat.

Poses, commands and the arbiter are never left out. The horizon stays, too: half the stages save a tenth of a
control step. Where more agents run on a computer than it serves, control periods are left out from take-off
on. Detecting the overload in flight would need all processors for a while, and starve processes of lower
priority.
"""

import time
from collections import deque
from collections.abc import Callable
from enum import IntEnum
from typing import Final

from rcopterx.agents.following.traffic import MOST, Traffic
from rcopterx.agents.load.pacing import Pacing
from rcopterx.bus.channels import LAUNCHER
from rcopterx.bus.host_messages import LauncherStatus
from rcopterx.bus.stepping import StepBus
from rcopterx.bus.subscription import Inbox, Received

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


FLOOR_EVERY: Final = 2
"""Largest number of control periods of which one is computed on the floor."""
NEAREST: Final = 3
"""Number of plans received for avoidance while those of far vehicles are left out."""
TOO_SLOW: Final = "this computer is too slow for its fleet"
_EVENTS: Final = {relief: f"relief_{int(relief)}" for relief in Relief}


class LoadRelief:
    """Watches how late one agent's commands are, and reduces the work of its parts.

    Decisions by measured times take effect by an event on the bus, so that a replay does the same.

    Parameters
    ----------
    launcher
        Statuses of the launcher of this host; None without one.
    processor_clock
        Processor time of this process [s].
    """

    def __init__(
        self,
        bus: StepBus,
        period_s: float,
        pacing: Pacing,
        traffic: Traffic,
        launcher: Inbox[LauncherStatus] | None = None,
        processor_clock: Callable[[], float] = time.process_time,
    ) -> None:
        self._bus, self._pacing, self._traffic = bus, pacing, traffic
        self._overload = Overload(period_s)
        self._processor_clock = processor_clock
        self._used_s, self._since_s = processor_clock(), bus.clock()
        self._seen = 0, 0
        self._launcher = Inbox(LAUNCHER) if launcher is None else launcher
        self._launcher_status: Received[LauncherStatus] | None = None
        self._planned = self._noted = Relief.NONE
        self.relief = Relief.NONE
        """What is left out at present."""
        self.events: dict[str, int] = {}

    @property
    def remark(self) -> str:
        """What is left out and why, for people; empty if nothing is."""
        if not self.relief:
            return ""
        reason = "more agents run on this computer than it serves" if self._planned else TOO_SLOW
        return f"{reason}: {self.relief.description}"

    def watch(self, late_s: float, flying: bool) -> None:
        """Process a control period, which took `late_s` from the arrival of its pose to its command."""
        pacing, (missed_before, overtaken_before) = self._pacing, self._seen
        self._seen = pacing.missed_ticks, pacing.overtaken_ticks
        # Periods missed for want of poses count once, those missed for want of time count all.
        missed = max(pacing.missed_ticks > missed_before, pacing.overtaken_ticks - overtaken_before)
        if self.relief:
            self._pace(flying)
        overload = self._overload
        if overload.observe(late_s, missed) if flying else overload.forget():
            self._bus.note(_EVENTS[overload.relief])

    def update(self) -> bool:
        """Apply the decisions made before this step; return whether there were any."""
        news = [self._plan(), self._take_decision()]
        relief = max(self._planned, self._noted)
        if relief is not self.relief:
            self._change(relief)
        return any(news)

    def _plan(self) -> bool:
        """Plan by the newest status of the launcher; return whether the plan changes."""
        received = self._launcher.latest()
        if received is None or received is self._launcher_status:
            return False
        self._launcher_status = received
        planned = planned_relief(received.message.crowding)
        if planned is self._planned:
            return False
        # Earlier decisions belong to another load.
        self._planned, self._noted = planned, Relief.NONE
        self._overload.plan(planned)
        return True

    def _take_decision(self) -> bool:
        events = self._bus.events
        decided = next((relief for relief, event in _EVENTS.items() if event in events), None)
        if decided is None:
            return False
        self._noted = decided
        return True

    def _change(self, relief: Relief) -> None:
        if relief > self.relief:
            name = f"left_out_{relief.name.lower()}"
            self.events[name] = self.events.get(name, 0) + 1
        self.relief = relief
        self._bus.publish_steps(relief < Relief.TELEMETRY)
        self._traffic.most = NEAREST if relief >= Relief.FAR_PLANS else MOST
        self._pace(flying=False)

    def _pace(self, flying: bool) -> None:
        # On the floor no planned inputs bridge a period that is left out, and arming needs fresh commands.
        self._pacing.every = self.relief.every if flying else min(FLOOR_EVERY, self.relief.every)

    def processor_share(self) -> float:
        """Share of one processor that this process has used since the last call."""
        used_s, now_s = self._processor_clock(), self._bus.clock()
        share = (used_s - self._used_s) / (now_s - self._since_s) if now_s > self._since_s else 0.0
        self._used_s, self._since_s = used_s, now_s
        return max(0.0, share)
