"""When an agent acts: it is paced by its poses, not by a timer."""

import math
from typing import Final, NamedTuple

import numpy as np

from rcopterx.vehicles.state import Array

COAST_AFTER_PERIODS = 1.5
WINDOW = 500
NEVER: Final = (-1, -1)
"""Earlier than epoch and frame of every period."""
REST_SPARE = 0.5
"""Frames before the next control period at which who rests looks for messages again."""


class Pacing:
    """Decides when a control period begins and when a pose counts as overdue.

    Parameters
    ----------
    period_s
        Control period; a whole multiple of the frame period.
    place
        Of the vehicle in its fleet. At half rate vehicles at even and odd places take turns.

    Attributes
    ----------
    overdue_at_s
        When the next pose counts as overdue [monotonic s]; infinite before the first.
    frames_per_tick
        Frames in one control period.
    """

    def __init__(self, period_s: float, place: int = 0) -> None:
        self.ticks = 0
        self.missed_ticks = 0
        self.overtaken_ticks = 0
        """Those of them whose poses had arrived."""
        self._period_s, self._place = period_s, place
        self._last_control_frame: int | None = None
        self._begun = self._commanded = NEVER
        self._last_arrival_s = self._frame_period_s = 0.0
        self._coasts = 0
        self.overdue_at_s = math.inf
        self.frames_per_tick = 1
        self.every = 1
        """Only every so many control periods are computed; the others fly the input planned for them."""

    def on_pose(self, arrived_s: float, frame_period_s: float) -> None:
        """A pose arrived, of a stream with this period."""
        self._last_arrival_s, self._coasts = arrived_s, 0
        self.overdue_at_s = arrived_s + COAST_AFTER_PERIODS * frame_period_s
        if frame_period_s != self._frame_period_s:
            self._frame_period_s = frame_period_s
            self.frames_per_tick = max(1, round(self._period_s / frame_period_s))

    def on_coast(self) -> None:
        """A frame was bridged by prediction."""
        self._coasts += 1
        self.overdue_at_s = self._last_arrival_s + (COAST_AFTER_PERIODS + self._coasts) * self._frame_period_s

    def on_begin(self, epoch: int, frame: int, flying: bool) -> None:
        """A control period begins; while flying one before it is missed if it has no command yet.

        A pose that comes late begins the period of its frame once more, to correct what was predicted for it.
        """
        period = epoch, frame
        if flying and self._commanded < self._begun < period:
            self.missed_ticks += 1
            self.overtaken_ticks += 1
        self._begun = period

    def on_command(self) -> None:
        """The command of the control period that began last is computed."""
        self._commanded = max(self._commanded, self._begun)

    def control_due(self, frame: int, flying: bool) -> bool:
        """Whether a control period begins with this frame.

        Every n-th frame by number, so that leaders and followers take the same ones; after a gap at once. At
        half rate they take turns, and followers fly by plans that are a period old.
        Control periods that passed without a command while flying are counted as missed.
        """
        per_tick, turn = self._turn()
        last = self._last_control_frame
        passed = 0 if last is None else frame - last
        if 0 < passed < per_tick and frame % per_tick != turn:
            return False
        if passed >= 2 * per_tick and flying:
            self.missed_ticks += passed // per_tick - 1
        self._last_control_frame = frame
        self.ticks += 1
        return True

    def plan_frame(self, frame: int) -> int:
        """Frame from which on plans of leaders are new enough for a period that begins with a frame.

        At a lower rate it is the period before, because who has the same turn plans at the same time.
        """
        return frame if self.every == 1 else frame - self._turn()[0]

    def rest_s(self, frame: int) -> float:
        """Rest after a frame that was controlled at a lower rate, until shortly before the next one."""
        if self.every == 1 or frame != self._last_control_frame:
            return 0.0
        per_tick, turn = self._turn()
        return (per_tick - (frame - turn) % per_tick - REST_SPARE) * self._frame_period_s

    def _turn(self) -> tuple[int, int]:
        """Frames from one control period to the next, and the remainder of those with which one begins."""
        full, every = self.frames_per_tick, self.every
        return (full, 0) if every == 1 else (every * full, self._place % every * full)

    def left_out(self, frame: int) -> bool:
        """Whether a control period that is not due would begin with this frame at full rate."""
        return self.every > 1 and frame % self.frames_per_tick == 0


class SolveTimes(NamedTuple):
    """Percentiles of the recent control steps [ms]."""

    p50: float
    p99: float
    maximum: float


class SolveTimer:
    """Durations of the last control steps."""

    def __init__(self) -> None:
        self._window: Array = np.empty(WINDOW)
        """A ring: the newest takes the place of the oldest."""
        self._steps = 0

    def add(self, duration_s: float) -> None:
        """Take in the duration of a step."""
        self._window[self._steps % WINDOW] = 1000 * duration_s
        self._steps += 1

    def times(self) -> SolveTimes:
        """Percentiles; zeros before the first step."""
        if not self._steps:
            return SolveTimes(0.0, 0.0, 0.0)
        # Once for all three: `numpy.percentile` takes twenty times as long.
        ordered = np.sort(self._window[: self._steps])
        return SolveTimes(_percentile(ordered, 0.5), _percentile(ordered, 0.99), float(ordered[-1]))


def _percentile(ordered: Array, share: float) -> float:
    """Value below which a share of ascending ones is, between two of them by straight line."""
    place = share * (len(ordered) - 1)
    lower = int(place)
    below, above = float(ordered[lower]), float(ordered[min(lower + 1, len(ordered) - 1)])
    return below + (place - lower) * (above - below)
