"""Pace of an agent, by its poses and not by a timer; which work it leaves out under overload."""

import math
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


COAST_AFTER_PERIODS = 1.5
NEVER: Final = (-1, -1)  # earlier than epoch and frame of every period
STRETCH: Final = 1.01  # of expected pose periods: lasting delays, inexact rates are no lateness
LONGEST_DELAY_S: Final = 0.3  # a later pose begins the expectation anew: something has paused
BURST_SHARE: Final = 0.5  # poses that arrive within this share of their periods have waited somewhere
REST_SPARE = 0.5  # frames before the next control period at which a resting agent reads messages again


class Pacing:
    """Decides when a control period begins and when a pose counts as overdue.

    At half rate vehicles at even and odd places of the fleet alternate.
    """

    def __init__(self, period_s: float, place: int = 0) -> None:
        self.ticks = 0
        self.missed_ticks = 0
        self.overtaken_ticks = 0  # those of the missed ticks whose poses had arrived
        self._period_s, self._place = period_s, place
        self._last_control_frame: int | None = None
        self._begun = self._commanded = NEVER
        self._last_arrival_s = self._due_s = math.inf
        self._last_frame = 0
        self.pose_delay_s = 0.0  # how much later than due the newest pose arrived, by frame numbers
        self.behind = False  # whether poses that waited during a pause still arrive
        self._frame_period_s = period_s
        self._coasts = 0
        self.every = 1  # one of so many control periods is computed; the others fly planned inputs

    @property
    def overdue_at_s(self) -> float:
        """When the next pose counts as overdue [monotonic s]; infinite before the first."""
        return self._last_arrival_s + (COAST_AFTER_PERIODS + self._coasts) * self._frame_period_s

    @property
    def frames_per_tick(self) -> int:
        """Number of frames in one control period."""
        return max(1, round(self._period_s / self._frame_period_s))

    def on_pose(self, frame: int, arrived_s: float, frame_period_s: float) -> None:
        """Process the arrival of the pose of a frame of a stream with this period."""
        elapsed, self._last_frame = frame - self._last_frame, frame
        due_s = self._due_s + STRETCH * elapsed * frame_period_s
        if arrived_s - due_s > LONGEST_DELAY_S:
            self.behind = True
        elif arrived_s - self._last_arrival_s > BURST_SHARE * elapsed * frame_period_s:
            self.behind = False
        if elapsed <= 0 or not 0.0 <= arrived_s - due_s <= LONGEST_DELAY_S:
            due_s = arrived_s
        self._due_s, self.pose_delay_s = due_s, arrived_s - due_s
        self._last_arrival_s, self._frame_period_s, self._coasts = arrived_s, frame_period_s, 0

    def on_coast(self) -> None:
        """Process a frame that was bridged by prediction."""
        self._coasts += 1
        self.behind = False

    def on_begin(self, epoch: int, frame: int, flying: bool) -> None:
        """Begin a control period, or once more that of a late pose; one without a command is missed."""
        period = epoch, frame
        if flying and self._commanded < self._begun < period:
            self.missed_ticks += 1
            self.overtaken_ticks += 1
        self._begun = period

    def on_command(self) -> None:
        """Note that the command of the present control period is computed."""
        self._commanded = max(self._commanded, self._begun)

    def control_due(self, frame: int, flying: bool) -> bool:
        """Return whether a control period begins with this frame: every n-th by number, or after a gap.

        At half rate vehicles alternate. Periods that passed without a command in flight are counted as
        missed.
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
        """Return the oldest frame of usable plans, at lower rates that of the period before."""
        return frame if self.every == 1 else frame - self._turn()[0]

    def rest_s(self, frame: int) -> float:
        """Return the time to rest after a frame that was controlled at a lower rate."""
        if self.every == 1 or frame != self._last_control_frame:
            return 0.0
        per_tick, turn = self._turn()
        return (per_tick - (frame - turn) % per_tick - REST_SPARE) * self._frame_period_s

    def _turn(self) -> tuple[int, int]:
        """Return the frames per control period, and the remainder of the frames that begin one."""
        full, every = self.frames_per_tick, self.every
        return (full, 0) if every == 1 else (every * full, self._place % every * full)

    def left_out(self, frame: int) -> bool:
        """Return whether a period that is left out would begin with this frame at full rate."""
        return self.every > 1 and frame % self.frames_per_tick == 0
