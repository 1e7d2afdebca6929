"""Has an agent leave out what its overload decides, at a step that a replay knows of."""

import time
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from rcopterx.agents.overload import Overload, Relief
from rcopterx.agents.pacing import Pacing
from rcopterx.agents.separation.traffic import MOST, Traffic
from rcopterx.bus.stepping import StepBus

NEAREST: Final = 3
"""Plans heard for avoidance while those of far vehicles are left out."""
RELIEF: Final = "relief_"
"""Notes begin with it; the number of the relief follows."""
_WORDS: Final = {relief: f"{RELIEF}{int(relief)}" for relief in Relief}


class LoadRelief:
    """Watches how late one agent's commands are, and lets its parts do less.

    What is decided by measured times takes effect by a note on the bus, so that a replay does the same.

    Parameters
    ----------
    bus
        The agent's seat on it.
    period_s
        Control period.
    pacing, traffic
        The agent's own.
    processor_clock
        Processor time of this process [s].
    """

    rejected: Mapping[str, int] = MappingProxyType({})

    def __init__(
        self,
        bus: StepBus,
        period_s: float,
        pacing: Pacing,
        traffic: Traffic,
        processor_clock: Callable[[], float] = time.process_time,
    ) -> None:
        self._bus, self._pacing, self._traffic = bus, pacing, traffic
        self._overload = Overload(period_s)
        self._processor_clock = processor_clock
        self._used_s, self._since_s = processor_clock(), bus.clock()
        self._seen = 0, 0
        self.relief = Relief.NONE
        """What is left out at present."""
        self.events: dict[str, int] = {}

    @property
    def remark(self) -> str:
        """What people should know; empty while nothing is left out."""
        return f"this computer is too slow for its fleet: {self.relief.words}" if self.relief else ""

    def watch(self, late_s: float, flying: bool) -> None:
        """Take in a control period: from the arrival of its pose until its command was sent."""
        pacing, (missed_before, overtaken_before) = self._pacing, self._seen
        self._seen = pacing.missed_ticks, pacing.overtaken_ticks
        # Missed for want of poses, however many, are one event; those behind which it lags are time.
        missed = max(pacing.missed_ticks > missed_before, pacing.overtaken_ticks - overtaken_before)
        overload = self._overload
        if overload.observe(late_s, missed) if flying else overload.forget():
            self._bus.note(_WORDS[overload.relief])

    def settle(self) -> bool:
        """Leave out what was decided before this step, or do it again; True if that is news."""
        words = self._bus.words
        if not words:
            return False
        for relief, word in _WORDS.items():
            if word in words:
                self._change(relief)
                return True
        return False

    def _change(self, relief: Relief) -> None:
        if relief > self.relief:
            name = f"left_out_{relief.name.lower()}"
            self.events[name] = self.events.get(name, 0) + 1
        self.relief = relief
        self._bus.tell_steps(relief < Relief.TELEMETRY)
        self._traffic.most = NEAREST if relief >= Relief.FAR_PLANS else MOST
        self._pacing.every = 2 if relief >= Relief.HALF_RATE else 1

    def processor_share(self) -> float:
        """Share of one processor that this process has used since the last call."""
        used_s, now_s = self._processor_clock(), self._bus.clock()
        share = (used_s - self._used_s) / (now_s - self._since_s) if now_s > self._since_s else 0.0
        self._used_s, self._since_s = used_s, now_s
        return max(0.0, share)
