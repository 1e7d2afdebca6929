"""Steps of a loop that must go on whatever fails in one of them."""

import time
from collections.abc import Callable
from typing import Final

from rcopterx.user_text import described

REPEAT_S: Final = 10.0  # an error of a step that repeats is reported again after this time
PAUSE_S: Final = 0.01  # after an error: a step that fails at once must not use the whole processor

Step = Callable[[], list[str] | None]  # returns a line per event, for the user


class Attempts:
    """Calls steps, and turns their errors into lines for the user; `clock` is monotonic [s]."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._silent_until_s: dict[str, float] = {}

    def __call__(self, name: str, step: Step) -> list[str]:
        """Return the lines of a step, or one with its error unless that was reported a moment ago."""
        try:
            return step() or []
        except Exception as error:  # noqa: BLE001 - whatever fails here, all other steps must go on
            time.sleep(PAUSE_S)
            now_s = self._clock()
            if now_s < self._silent_until_s.get(name, now_s):
                return []
            self._silent_until_s[name] = now_s + REPEAT_S
            return [f"launcher: {name} failed: {described(error)}; going on"]
