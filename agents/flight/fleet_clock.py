"""The Tracker's frame number as a clock, and the inputs under way to the vehicle on that clock."""

from collections import deque
from dataclasses import dataclass

from rcopterx.vehicles.state import Array

HISTORY_LENGTH = 64
TIME_TOLERANCE_S = 1e-6


class FleetClock:
    """Counts the frame periods that have passed, also those in which no frame came.

    Frames that were bridged by coasting are not counted a second time when the Tracker resumes.
    """

    def __init__(self) -> None:
        self.epoch = 0
        self.frame = 0
        self.period_s = 0.0
        self.coasted = 0
        self.current_frame = 0
        """Number of the frame that belongs to the present, coasted ones included."""
        self.time_s = 0.0
        """Time since the first frame."""
        self.started = False

    def frames_until(self, epoch: int, frame: int, period_s: float) -> int:
        """Return the number of periods to be predicted up to a received frame; -1 for an old frame or epoch.

        It is 1 in undisturbed flight, and 0 where coasting has covered them already.
        """
        if self.started and epoch == self.epoch:
            elapsed = frame - self.frame
            if elapsed <= 0:
                return -1
        elif self.started and epoch < self.epoch:
            return -1  # Epochs only grow: this one comes from a gateway that has been replaced.
        else:
            elapsed = 1 if self.started else 0
        self.epoch, self.frame, self.period_s, self.started = epoch, frame, period_s, True
        pending = elapsed - self.coasted
        self.current_frame, self.coasted = frame, 0
        return max(pending, 0)

    def pass_period(self) -> None:
        """Advance by one frame period."""
        self.time_s += self.period_s

    def coast(self) -> None:
        """Advance by one frame period without a frame."""
        self.coasted += 1
        self.current_frame += 1
        self.pass_period()


@dataclass(slots=True)
class _Entry:
    effect_from_s: float
    sequence: int
    input: Array


class InputHistory:
    """Inputs sent and not yet, or just, acting; ordered by the time their effect begins."""

    def __init__(self, initial_input: Array) -> None:
        self._entries: deque[_Entry] = deque([_Entry(-1.0, 0, initial_input)], maxlen=HISTORY_LENGTH)

    @property
    def newest(self) -> Array:
        """Input sent last, shape (4,)."""
        return self._entries[-1].input

    def append(self, effect_from_s: float, sequence: int, value: Array) -> None:
        """Record an input that acts from a time on."""
        self._entries.append(_Entry(effect_from_s, sequence, value))

    def correct(self, sequence: int, value: Array) -> None:
        """Replace the input of a sequence number by the one that the transmitter gateway applied."""
        for entry in reversed(self._entries):
            if entry.sequence == sequence:
                entry.input = value
                return
            if entry.sequence < sequence:
                return

    def between(self, start_s: float, end_s: float) -> list[tuple[Array, float]]:
        """Return the inputs that act in an interval, in order, with the duration [s] of each."""
        if start_s >= end_s - TIME_TOLERANCE_S:
            return []
        pieces: list[tuple[Array, float]] = []
        until_s = end_s
        for entry in reversed(self._entries):
            from_s = entry.effect_from_s
            if from_s <= start_s + TIME_TOLERANCE_S:
                pieces.append((entry.input, until_s - start_s))
                break
            if until_s - from_s > TIME_TOLERANCE_S:
                pieces.append((entry.input, until_s - from_s))
                until_s = from_s
        else:
            # Before the oldest known input, the same one is assumed.
            pieces.append((self._entries[0].input, until_s - start_s))
        pieces.reverse()
        return pieces
