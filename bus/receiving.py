"""Callbacks on Zenoh's threads, and how they wake the loop of a process."""

import ctypes
import threading
from collections.abc import Callable
from typing import Final, TypeVar

from zenoh.handlers import Callback

T = TypeVar("T")

_prepared: Final = threading.local()
_hold_thread_state: Final[Callable[[], int]] = ctypes.pythonapi.PyGILState_Ensure


def direct(callback: Callable[[T], object]) -> "Callback[T]":
    """Handler that calls a function on the thread that receives, without a thread in between.

    Python makes a state for a thread that is not its own, 16 kB of fresh memory, and gives it back after each
    call. Here the first call on a thread keeps it: it enters once more than it leaves.

    Parameters
    ----------
    callback
        Called with what arrived.
    """

    def called(received: T) -> None:
        if not hasattr(_prepared, "kept"):
            _hold_thread_state()
            _prepared.kept = True
        callback(received)

    return Callback(called, indirect=False)


class Wake:
    """Wakes one thread that waits; what `threading.Event` does, with one lock instead of three objects."""

    def __init__(self) -> None:
        self._nothing = threading.Lock()
        self._nothing.acquire()

    def set(self) -> None:
        """Let the thread that waits, or the next one that will, go on. May be called by any thread."""
        # For every message; a context manager would take longer than all the rest.
        try:
            self._nothing.release()
        except RuntimeError:
            return

    def wait(self, timeout_s: float) -> bool:
        """Wait until `set` is called, or has been since the last wait; False if the time is over before."""
        return self._nothing.acquire(timeout=timeout_s)
