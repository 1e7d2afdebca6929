"""The time of a vehicle in frames of the Tracker, and its inputs over time."""

from collections import deque
from typing import Final

import numpy as np
from msgspec import Struct

from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import Array


class FleetClock:
    """Counts the frame periods that have passed; frames bridged by coasting are counted once."""

    def __init__(self) -> None:
        self.epoch = 0
        self.frame = 0
        self.period_s = 0.0
        self.current_frame = 0  # number of the frame that belongs to the present, coasted ones included
        self.time_s = 0.0  # time since the first frame
        self.started = False

    def frames_until(self, epoch: int, frame: int, period_s: float) -> int:
        """Return the periods to predict up to a frame: 1 undisturbed, 0 after coasting, -1 if it is old."""
        if self.started and epoch == self.epoch:
            elapsed = frame - self.frame
            if elapsed <= 0:
                return -1
        elif self.started and epoch < self.epoch:
            return -1  # Epochs only grow: this one comes from a gateway that has been replaced.
        else:
            elapsed = 1 if self.started else 0
        coasted = self.current_frame - self.frame
        self.epoch, self.frame, self.period_s, self.started = epoch, frame, period_s, True
        self.current_frame = frame
        return max(elapsed - coasted, 0)

    def frame_problem(self, epoch: int, frame: int) -> str | None:
        """Return why nothing can begin at a frame any more; None if it lies ahead."""
        if epoch != self.epoch:
            return f"the stream of frames is another one now: epoch {self.epoch}, not {epoch}"
        if frame <= self.current_frame:
            return f"frame {frame} has passed, the present one is {self.current_frame}"
        return None

    def pass_period(self) -> None:
        """Advance by one frame period."""
        self.time_s += self.period_s

    def coast(self) -> None:
        """Advance by one frame period without a frame."""
        self.current_frame += 1
        self.pass_period()


FADING_TIME_S: Final = 0.09  # time constant of the decay of differences by another controller or estimator
END: Final = 1e-3  # difference that counts as none


HISTORY_LENGTH: Final = 64
TIME_TOLERANCE_S: Final = 1e-6


class BumplessTransfer:
    """Lets the first difference of the inputs after a change fade away."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._pending = False
        self._difference: Array | None = None

    def begin(self) -> None:
        """Begin a transfer: the next inputs come from another controller or estimator."""
        self._pending = True

    def smoothed(self, inputs: Array, last_input: Array, period_s: float) -> Array:
        """Return the inputs from this period on, shape (k, 4), with the rest of the difference."""
        if self._pending:
            self._pending = False
            self._difference = last_input - inputs[0]
        if self._difference is None:
            return inputs
        ages_s = period_s * np.arange(1, len(inputs) + 1)
        fading: Array = self._difference * np.exp(-ages_s / FADING_TIME_S)[:, None]
        self._difference = fading[0] if np.abs(fading[0]).max() > END else None
        return np.clip(inputs + fading, self._model.u_min, self._model.u_max)


INPUT_UNIT: Final = 2.0**-12  # an eighth of the finest radio's steps, as a binary fraction for small logs


def as_sent(inputs: Array, model: Model) -> Array:
    """Return inputs, shape (k, 4), in whole `INPUT_UNIT`, but for those at the limits of the vehicle."""
    return np.clip(np.rint(inputs / INPUT_UNIT) * INPUT_UNIT, model.u_min, model.u_max)


class _Entry(Struct):
    effect_from_s: float
    sequence: int
    input: Array


class InputHistory:
    """Inputs sent and not yet, or just, acting; ordered by the time their effect begins."""

    def __init__(self, initial_input: Array) -> None:
        self._entries: deque[_Entry] = deque(maxlen=HISTORY_LENGTH)
        self.restart(initial_input)

    @property
    def newest(self) -> Array:
        """Input sent last, shape (4,)."""
        return self._entries[-1].input

    def restart(self, value: Array) -> None:
        """Forget all inputs but one, which has been acting."""
        self._entries.clear()
        self.append(-1.0, 0, value)

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
