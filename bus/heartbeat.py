"""How a process shows its supervisor progress: its working loop counts turns on a page that it inherits.

Only the loop itself beats: a helper thread would continue while the loop hangs.
"""

import mmap
import os
from enum import IntEnum
from functools import cache
from typing import Final

VARIABLE: Final = "RCOPTERX_HEARTBEAT"  # environment variable with the file descriptor of the page
LONGEST_WAIT_S: Final = 0.05  # longest wait of a loop for events: an idle loop makes progress as well
_COUNT, _PHASE = 0, 1
_BYTES = 16


class LoopPhase(IntEnum):
    """What a process reports beside the count."""

    STARTING = 0  # its loop does not run yet
    WORKING = 1
    FLYING = 2  # working, and a vehicle's rotor turns
    ENDING = 3  # its loop has ended


class Heartbeat:
    """The process's side, on a page of at least 16 bytes."""

    def __init__(self, page: mmap.mmap | bytearray) -> None:
        # Aligned words of eight bytes are stored at once; there is one writer.
        self._words = memoryview(page).cast("Q")

    def beat(self, flying: bool = False) -> None:
        """Count a turn of the loop; `flying` if a rotor is known to turn."""
        self._words[_COUNT] += 1
        self._words[_PHASE] = LoopPhase.FLYING if flying else LoopPhase.WORKING

    def starting(self) -> None:
        """Request the longer limit that applies until the loop runs; for a spare that takes over."""
        self._words[_PHASE] = LoopPhase.STARTING

    def ending(self) -> None:
        """Request the longer limit that applies after the loop has ended."""
        self._words[_PHASE] = LoopPhase.ENDING


class HeartbeatPage:
    """The supervisor's side; created before the process. Raises OSError without descriptors or memory."""

    def __init__(self) -> None:
        self.descriptor = os.memfd_create("rcopterx-heartbeat")
        try:
            os.truncate(self.descriptor, mmap.PAGESIZE)
            memory = mmap.mmap(self.descriptor, mmap.PAGESIZE)
        except OSError:
            os.close(self.descriptor)
            raise
        self._words = memoryview(memory).cast("Q")

    def handed_over(self) -> None:
        """Close the descriptor once the process has inherited it."""
        os.close(self.descriptor)

    @property
    def beats(self) -> int:
        """Number of turns of the loop."""
        return self._words[_COUNT]

    @property
    def phase(self) -> LoopPhase:
        """Phase that the process reports."""
        value = self._words[_PHASE]
        return LoopPhase(value) if value <= LoopPhase.ENDING else LoopPhase.STARTING


@cache
def own_heartbeat() -> Heartbeat:
    """Return the heartbeat of this process; without a supervisor it is on memory of its own."""
    descriptor = os.environ.pop(VARIABLE, None)
    if descriptor is None:
        return Heartbeat(bytearray(_BYTES))
    page = mmap.mmap(int(descriptor), mmap.PAGESIZE)
    os.close(int(descriptor))
    return Heartbeat(page)
