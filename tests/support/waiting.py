"""Waiting for conditions with a deadline, never for luck."""

import time
from collections.abc import Callable

DEADLINE_S = 15.0
POLL_S = 0.005


def wait_for(condition: Callable[[], object], what: str, deadline_s: float = DEADLINE_S) -> None:
    """Wait until a condition holds; fails the test with `what` if it does not in time."""
    end_s = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end_s, f"after {deadline_s:g} s: {what}"
        time.sleep(POLL_S)


class FakeClock:
    """A monotonic clock that tests set by hand."""

    def __init__(self, now_s: float = 100.0) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        return self.now_s

    def advance(self, seconds: float) -> None:
        self.now_s += seconds
