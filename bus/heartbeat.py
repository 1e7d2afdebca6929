"""How a process shows its supervisor that its working loop makes progress.

The supervisor hands each process a page of shared memory. The process counts the turns of its loop in it,
which takes no system call and wakes nobody; the supervisor looks whether the count changes. Nothing but the
loop itself may beat: a helper thread would go on while the loop hangs.
"""

import mmap
import os
from enum import IntEnum
from functools import cache
from typing import Final

VARIABLE: Final = "RCOPTERX_HEARTBEAT"
"""Environment variable with the descriptor of the page."""
LONGEST_WAIT_S: Final = 0.05
"""How long a loop may wait for something to do: an idle one makes progress as well."""
_COUNT, _PHASE = 0, 1
_BYTES = 16


class Phase(IntEnum):
    """What a process says of itself beside the count."""

    STARTING = 0
    """Its loop does not run yet."""
    WORKING = 1
    FLYING = 2
    """Working, and knows of a vehicle whose rotor turns."""
    ENDING = 3
    """Its loop does not run any more."""


_WORKING, _FLYING = int(Phase.WORKING), int(Phase.FLYING)


class Heartbeat:
    """The process's side.

    Parameters
    ----------
    page
        Memory of at least 16 bytes; a process without a supervisor beats into memory of its own.
    """

    def __init__(self, page: mmap.mmap | bytearray) -> None:
        # Aligned words of eight bytes are stored at once; there is one writer.
        self._words = memoryview(page).cast("Q")

    def beat(self, flying: bool = False) -> None:
        """Show that the loop has come round; `flying` tells whether a rotor is known to turn."""
        words = self._words
        words[_COUNT] += 1
        words[_PHASE] = _FLYING if flying else _WORKING

    def starting(self) -> None:
        """Ask for the patience that a process needs until its loop runs; a spare does when it takes over."""
        self._words[_PHASE] = Phase.STARTING

    def ending(self) -> None:
        """Ask for the patience that a process needs after its loop has ended."""
        self._words[_PHASE] = Phase.ENDING


class HeartbeatPage:
    """The supervisor's side: made before the process, kept as long as somebody reads it.

    Raises
    ------
    OSError
        No descriptors or no memory left.
    """

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
        """How often the loop has come round."""
        return self._words[_COUNT]

    @property
    def phase(self) -> Phase:
        """What the process says of itself."""
        value = self._words[_PHASE]
        return Phase(value) if value <= Phase.ENDING else Phase.STARTING


@cache
def own_heartbeat() -> Heartbeat:
    """Heartbeat of this process: on the page that its supervisor handed over, if there is one."""
    descriptor = os.environ.pop(VARIABLE, None)
    if descriptor is None:
        return Heartbeat(bytearray(_BYTES))
    page = mmap.mmap(int(descriptor), mmap.PAGESIZE)
    os.close(int(descriptor))
    return Heartbeat(page)
