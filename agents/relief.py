"""Relief of an overloaded agent: it leaves out work, from a step on that a replay can repeat.

Poses, commands and the arbiter are never left out. The horizon stays, too: half the stages save a tenth of a
control step. Where more agents run on a computer than it serves, control periods are left out from take-off
on: until an overload is detected in flight, it starves what has no real-time priority, such as serial lines.
"""

from collections import Counter, deque
from dataclasses import dataclass
from typing import Final

from rcopterx.agents.following.traffic import MOST, Traffic
from rcopterx.agents.load import Overload, Pacing, Relief, planned_relief
from rcopterx.bus.host_messages import LauncherStatus
from rcopterx.bus.messages import Diagnostics
from rcopterx.bus.stepping import StepBus
from rcopterx.bus.subscription import Inbox, Received

FLOOR_EVERY: Final = 2  # largest number of control periods of which one is computed on the floor
NEAREST: Final = 3  # number of plans received for avoidance while those of far vehicles are left out
SOLVE_WINDOW: Final = 500  # number of control steps whose durations are reported
TOO_SLOW: Final = "this computer is too slow for its fleet"
_EVENTS: Final = {relief: f"relief_{int(relief)}" for relief in Relief}


@dataclass
class LoadRelief:
    """Watches how late one agent's commands are, and reduces the work of its parts.

    Decisions by measured times take effect by an event on the bus, so that a replay does the same.
    """

    bus: StepBus
    period_s: float
    pacing: Pacing
    traffic: Traffic
    launcher: Inbox[LauncherStatus]
    events: Counter[str]

    def __post_init__(self) -> None:
        self.overload = Overload(self.period_s)
        self.relief = Relief.NONE  # what is left out at present
        self.solve_ms: deque[float] = deque(maxlen=SOLVE_WINDOW)  # durations of the last control steps
        self._planned = self._noted = Relief.NONE
        self._launcher_status: Received[LauncherStatus] | None = None
        self._seen = 0, 0

    @property
    def remark(self) -> str:
        """What is left out and why, for people; empty if nothing is."""
        if not self.relief:
            return ""
        reason = "more agents run on this computer than it serves" if self._planned else TOO_SLOW
        return f"{reason}: {self.relief.description}"

    def watch(self, late_s: float, flying: bool) -> None:
        """Process a control period, whose command left `late_s` after its pose was due."""
        pacing, (missed_before, overtaken_before) = self.pacing, self._seen
        self._seen = pacing.missed_ticks, pacing.overtaken_ticks
        # Periods missed for want of poses count once, those missed for want of time count all.
        missed = max(pacing.missed_ticks > missed_before, pacing.overtaken_ticks - overtaken_before)
        if self.relief:
            self._pace(flying)
        overload = self.overload
        if overload.observe(late_s, missed) if flying else overload.stand(late_s):
            self.bus.note(_EVENTS[overload.relief])

    def update(self) -> bool:
        """Apply the decisions made before this step; return whether there were any."""
        planned = self._plan()
        noted = [relief for relief, event in _EVENTS.items() if event in self.bus.events]
        if noted:
            self._noted = noted[0]
        relief = max(self._planned, self._noted)
        if relief is not self.relief:
            self._change(relief)
        return planned or bool(noted)

    def _plan(self) -> bool:
        """Plan by the newest status of the launcher; return whether the plan changes."""
        received = self.launcher.latest()
        if received is None or received is self._launcher_status:
            return False
        self._launcher_status = received
        planned = planned_relief(received.message.control_every)
        if planned is self._planned:
            return False
        # Earlier decisions belong to another load.
        self._planned, self._noted = planned, Relief.NONE
        self.overload.plan(planned)
        return True

    def _change(self, relief: Relief) -> None:
        if relief > self.relief:
            self.events[f"left_out_{relief.name.lower()}"] += 1
        self.relief = relief
        self.bus.publishing = relief < Relief.REPORTS
        self.traffic.most = NEAREST if relief >= Relief.REPORTS else MOST
        self._pace(flying=False)

    def _pace(self, flying: bool) -> None:
        # On the floor no planned inputs bridge a period that is left out, and arming needs fresh commands.
        self.pacing.every = self.relief.every if flying else min(FLOOR_EVERY, self.relief.every)

    def report(self, to: Diagnostics, now_s: float) -> None:  # noqa: ARG002 - see `Reports`
        """See `rcopterx.agents.reporting.Reports`."""
        ordered = sorted(self.solve_ms) or [0.0]
        last = len(ordered) - 1
        to.solve_ms_p50, to.solve_ms_p99 = ordered[round(0.5 * last)], ordered[round(0.99 * last)]
        to.solve_ms_max = ordered[-1]
        to.ticks, to.missed_ticks = self.pacing.ticks, self.pacing.missed_ticks
        to.remarks += (self.remark,)
