"""Calls of the arbiters of a gateway, with which a replay repeats their decisions."""

from collections import deque
from typing import Final

from rcopterx.bus.log_messages import ArbiterCall, ArbiterCalls, Argument

MOST_CALLS: Final = 32768  # that wait to be published, some seconds; without a bus the oldest are dropped
CALLS_PER_MESSAGE: Final = 256


class Journal:
    """Keeps calls until they are published; `began_s` identifies the process."""

    def __init__(self, began_s: float = 0.0) -> None:
        self._began_s = began_s
        self._calls: deque[ArbiterCall] = deque(maxlen=MOST_CALLS)
        self._number = 0  # of the next call
        self._newest: dict[tuple[str, str], tuple[Argument, ...]] = {}

    def note(self, call: str, vehicle: str, now_s: float, *arguments: Argument) -> None:
        """Add a call; see `ArbiterCalls`."""
        self._calls.append((call, vehicle, now_s, arguments))
        self._number += 1

    def note_change(self, call: str, vehicle: str, now_s: float, *arguments: Argument) -> None:
        """Add a call that has no effect unless its arguments differ from those of the last one."""
        if self._newest.get((call, vehicle)) != arguments:
            self._newest[call, vehicle] = arguments
            self.note(call, vehicle, now_s, *arguments)

    def take(self) -> ArbiterCalls:
        """Remove and return some calls, the oldest first, or none if there are none."""
        number = self._number - len(self._calls)
        calls = [self._calls.popleft() for _ in range(min(len(self._calls), CALLS_PER_MESSAGE))]
        return ArbiterCalls(began_s=self._began_s, number=number, calls=tuple(calls))
