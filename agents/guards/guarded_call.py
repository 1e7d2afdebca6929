"""Calls of controllers and estimators, which may be plug-ins: they may fail, and the caller goes on."""

from collections import Counter
from collections.abc import Callable
from typing import Final, TypeVar

from rcopterx.agents.guards.time_limit import OutOfTimeError, TimeLimit

LONGEST_TEXT: Final = 300

T = TypeVar("T")


class GuardedCall:
    """Calls with a time limit whose failures are counted, under names that begin with `part`.

    The first calls load code and fill caches, and may take `first_calls_factor` times as long.
    """

    def __init__(self, part: str, first_calls: int, first_calls_factor: float) -> None:
        self.limit = TimeLimit()
        self.failures: Counter[str] = Counter()  # failures by kind: `..._raised`, `..._unusable`, `..._late`
        self.failure = ""  # description of the last failure; empty before the first one
        self._part = part
        self._first_calls, self._first_calls_factor = first_calls, first_calls_factor
        self._calls = 0

    def begin(self) -> None:
        """Allow the longer time of first calls again, because another object is called from now on."""
        self._calls = 0

    def allowed_s(self, limit_s: float) -> float:
        """Return the time that the next call may take where later ones may take `limit_s`."""
        return limit_s if self._calls >= self._first_calls else limit_s * self._first_calls_factor

    def attempt(
        self, name: str, limit_s: float, call: Callable[[], T], problem: Callable[[T], str | None]
    ) -> T | None:
        """Call something; return None after a failure, which is counted. `problem` says what is unusable."""
        limit, allowed_s = self.limit, self.allowed_s(limit_s)
        self._calls += 1
        try:
            try:
                limit.begin(allowed_s)
                result = call()
                late = limit.end(allowed_s)
            except BaseException as error:
                # Also where the time ran out just when the call was over.
                limit.end(allowed_s)
                if not _interrupted(error):
                    raise
                late = True
            found = None if late else problem(result)
        except OutOfTimeError:
            # The alarm rang while an exception was handled.
            late = limit.end(allowed_s)
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            self.note("raised", f"{name}: {type(error).__name__}: {error}")
            return None
        if late:
            self.note("late", f"{name}: a call took longer than {1e3 * allowed_s:.0f} ms")
        elif found is not None:
            self.note("unusable", f"{name}: {found}")
        else:
            return result
        return None

    def try_call(self, name: str, action: Callable[[], None]) -> None:
        """Call something without a time limit; an exception is counted."""
        try:
            action()
        except Exception as error:  # noqa: BLE001 - a plug-in may raise anything
            self.note("raised", f"{name}: {type(error).__name__}: {error}")

    def note(self, kind: str, text: str) -> None:
        """Count a failure and keep its description."""
        self.failures[f"{self._part}_{kind}"] += 1
        self.failure = text[:LONGEST_TEXT]


def _interrupted(error: BaseException | None) -> bool:
    """Return whether an exception comes from `OutOfTimeError`, or a `SystemError` that it caused."""
    while isinstance(error, SystemError):
        error = error.__cause__
    return isinstance(error, OutOfTimeError)
