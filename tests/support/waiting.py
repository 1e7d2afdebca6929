"""Waiting for conditions with a deadline, never for luck."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

DEADLINE_S = 60.0
"""Only bounds how long a test takes to fail: a busy machine may stall for seconds."""
POLL_S = 0.005


def wait_for(condition: Callable[[], object], what: str, deadline_s: float = DEADLINE_S) -> None:
    """Wait until a condition holds; fails the test with `what` if it does not in time."""
    end_s = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end_s, f"after {deadline_s:g} s: {what}"
        time.sleep(POLL_S)


def is_running(pid: int) -> bool:
    """Whether a process has not ended; one whose parent has not noticed that has."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rsplit(")", 1)[1].split()[0] != "Z"


class FakeClock:
    """A monotonic clock that tests set by hand."""

    def __init__(self, now_s: float = 100.0) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        return self.now_s

    def advance(self, seconds: float) -> None:
        self.now_s += seconds


class PatientClock:
    """Monotonic time that advances by at most `longest_s` per reading, without stalls of the machine.

    Threads may share it.
    """

    def __init__(self, longest_s: float) -> None:
        self._longest_s = longest_s
        self._read_s = time.monotonic()
        self._now_s = 100.0
        self._lock = threading.Lock()

    def __call__(self) -> float:
        with self._lock:
            read_s = time.monotonic()
            self._now_s += min(read_s - self._read_s, self._longest_s)
            self._read_s = read_s
            return self._now_s
