"""When an agent acts: it is paced by its poses, not by a timer."""

from typing import NamedTuple

import numpy as np

from rcopterx.vehicles.state import Array

COAST_AFTER_PERIODS = 1.5
WINDOW = 500
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
    """

    def __init__(self, period_s: float, place: int = 0) -> None:
        self.ticks = 0
        self.missed_ticks = 0
        self.overtaken_ticks = 0
        """Those of them whose poses had arrived."""
        self._period_s, self._place = period_s, place
        self._last_control_frame: int | None = None
        self._last_arrival_s: float | None = None
        self._coasts = 0
        self.every = 1
        """Only every so many control periods are computed; the others fly the input planned for them."""

    def frames_per_tick(self, frame_period_s: float) -> int:
        """Frames in one control period."""
        return max(1, round(self._period_s / frame_period_s))

    def on_pose(self, arrived_s: float) -> None:
        """A pose arrived."""
        self._last_arrival_s = arrived_s
        self._coasts = 0

    def coast_at_s(self, frame_period_s: float) -> float | None:
        """Time at which the next pose counts as overdue; None before the first."""
        if self._last_arrival_s is None:
            return None
        return self._last_arrival_s + (COAST_AFTER_PERIODS + self._coasts) * frame_period_s

    def on_coast(self) -> None:
        """A frame was bridged by prediction."""
        self._coasts += 1

    def on_overtaken(self) -> None:
        """A control period began before the command of the one before was computed."""
        self.missed_ticks += 1
        self.overtaken_ticks += 1

    def control_due(self, frame: int, frame_period_s: float, flying: bool) -> bool:
        """Whether a control period begins with this frame.

        Every n-th frame by number, so that leaders and followers take the same ones; after a gap at once. At
        half rate they take turns, and followers fly by plans that are a period old.
        Control periods that passed without a command while flying are counted as missed.
        """
        per_tick, turn = self._turn(frame_period_s)
        last = self._last_control_frame
        if last is not None and 0 < frame - last < per_tick and frame % per_tick != turn:
            return False
        if last is not None and flying and frame > last:
            self.missed_ticks += max(0, (frame - last) // per_tick - 1)
        self._last_control_frame = frame
        self.ticks += 1
        return True

    def plan_frame(self, frame: int, frame_period_s: float) -> int:
        """Frame from which on plans of leaders are new enough for a period that begins with a frame.

        At a lower rate it is the period before, because who has the same turn plans at the same time.
        """
        return frame if self.every == 1 else frame - self._turn(frame_period_s)[0]

    def rest_s(self, frame: int, frame_period_s: float) -> float:
        """Rest after a frame that was controlled at a lower rate, until shortly before the next one."""
        if self.every == 1 or frame != self._last_control_frame:
            return 0.0
        per_tick, turn = self._turn(frame_period_s)
        return (per_tick - (frame - turn) % per_tick - REST_SPARE) * frame_period_s

    def _turn(self, frame_period_s: float) -> tuple[int, int]:
        """Frames from one control period to the next, and the remainder of those with which one begins."""
        full = self.frames_per_tick(frame_period_s)
        return self.every * full, self._place % self.every * full

    def left_out(self, frame: int, frame_period_s: float) -> bool:
        """Whether a control period that is not due would begin with this frame at full rate."""
        return self.every > 1 and frame % self.frames_per_tick(frame_period_s) == 0


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
