"""Relief of an overloaded agent: it leaves out work, from a step on that a replay can repeat.

Poses, commands and the arbiter are never left out. The horizon stays, too: half the stages save a tenth of a
control step. Where more agents run on a computer than it serves, control periods are left out from take-off
on: until an overload is detected in flight, it starves what has no real-time priority, such as serial lines.
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
"""A command that leaves so many control periods after its pose was due is late."""
WINDOW_S: Final = 1.0
LATE_SHARE: Final = 0.3
"""Share of late and missed control periods in a window above which work is left out."""
EASE_AFTER_S: Final = 10.0
"""Time without overload after which the last work that was left out is done again."""
LONGEST_EASE_AFTER_S: Final = 160.0
"""The time doubles up to this each time when work that was done again had to be left out at once."""


class Relief(IntEnum):
    """Work that is left out; each level includes all before it."""

    NONE = 0
    REPORTS = 1
    """Statuses and intents are published half as often, and inputs of steps not at all: the replay has a gap
    there. For avoidance only the plans of the nearest vehicles are received."""
    HALF_RATE = 2
    """Every second control period flies the input that was planned for it."""
    THIRD_RATE = 3
    """Two of three do."""
    QUARTER_RATE = 4
    """Three of four do."""

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
        """Process a control period in flight; return whether `relief` has changed, by one level.

        `late_s` is the time from when its pose was due to its command; `missed` periods before it had
        something to compute.
        """
        self._note(late_s, missed)
        self._calm_s += self._period_s * self.relief.every
        if self.late_share > LATE_SHARE:
            return self._leave_out()
        return self._calm_s >= self._ease_after_s and self._do_again()

    def stand(self, late_s: float) -> bool:
        """Process a control period on the floor, where no more than planned is left out.

        Returns whether it was more.
        """
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

    @property
    def late_share(self) -> float:
        """Share of the last commands that were late or missing."""
        return self._overload.late_share

    def watch(self, late_s: float, flying: bool) -> None:
        """Process a control period, whose command left `late_s` after its pose was due."""
        pacing, (missed_before, overtaken_before) = self._pacing, self._seen
        self._seen = pacing.missed_ticks, pacing.overtaken_ticks
        # Periods missed for want of poses count once, those missed for want of time count all.
        missed = max(pacing.missed_ticks > missed_before, pacing.overtaken_ticks - overtaken_before)
        if self.relief:
            self._pace(flying)
        overload = self._overload
        if overload.observe(late_s, missed) if flying else overload.stand(late_s):
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
        planned = planned_relief(received.message.control_every)
        if planned is self._planned:
            return False
        # Earlier decisions belong to another load.
        self._planned, self._noted = planned, Relief.NONE
        self._overload.plan(planned)
        return True

    def _take_decision(self) -> bool:
        events = self._bus.events
        if not events:
            return False
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
        self._bus.publish_steps(relief < Relief.REPORTS)
        self._traffic.most = NEAREST if relief >= Relief.REPORTS else MOST
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
