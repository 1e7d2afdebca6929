"""Calls of code that may be somebody else's: whatever it does, the caller goes on, and failures are told."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeVar

from rcopterx.agents.guards.time_limit import NoTimeLimit, OutOfTimeError, TimeLimit

LONGEST_TEXT: Final = 300

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class FailureKinds:
    """Names under which failures are counted.

    Attributes
    ----------
    raised
        An exception.
    unusable
        An answer that is none.
    late
        No answer in time.
    """

    raised: str
    unusable: str
    late: str


class GuardedCall:
    """Calls with a time limit whose failures are counted.

    Parameters
    ----------
    kinds
        How failures are counted.
    first_calls, first_calls_factor
        The first calls load code and fill caches; so many of them may take so many times as long.
    limit
        Time that a call may take; None for none.

    Attributes
    ----------
    failures
        How often which kind of failure happened.
    failure
        What the last failure was; empty before the first one.
    """

    def __init__(
        self,
        kinds: FailureKinds,
        first_calls: int,
        first_calls_factor: float,
        limit: TimeLimit | None = None,
    ) -> None:
        self.limit = NoTimeLimit() if limit is None else limit
        self.failures: Counter[str] = Counter()
        self.failure = ""
        self._kinds = kinds
        self._first_calls, self._first_calls_factor = first_calls, first_calls_factor
        self._calls = 0

    def begin(self) -> None:
        """Count the first calls anew: somebody else is asked from now on."""
        self._calls = 0

    def allowed_s(self, limit_s: float) -> float:
        """Time that the next call may take where later ones may take `limit_s`."""
        return limit_s if self._calls >= self._first_calls else limit_s * self._first_calls_factor

    def attempt(
        self, name: str, limit_s: float, question: Callable[[], T], problem: Callable[[T], str | None]
    ) -> T | None:
        """Ask for something.

        Parameters
        ----------
        name
            Who is asked, for the text of a failure.
        limit_s
            Time that the call may take but for the first ones.
        question
            Asks; may raise anything.
        problem
            What makes an answer unusable; None for one that can be used. May raise as well.

        Returns
        -------
        T or None
            A usable answer, or None after a failure, which has been counted.
        """
        limit, allowed_s = self.limit, limit_s
        if self._calls < self._first_calls:
            allowed_s = self.allowed_s(limit_s)
        self._calls += 1
        try:
            try:
                limit.begin(allowed_s)
                answer = question()
                late = limit.end(allowed_s)
            except BaseException as error:
                # Also where the time ran out just when the call was over.
                limit.end(allowed_s)
                if not _interrupted(error):
                    raise
                late = True
            found = None if late else problem(answer)
        except OutOfTimeError:
            # It rang while a failure was looked at.
            late = limit.end(allowed_s)
        except Exception as error:  # noqa: BLE001 - it may be somebody else's and raise anything
            self._note(self._kinds.raised, f"{name}: {type(error).__name__}: {error}")
            return None
        if late:
            self._note(self._kinds.late, f"{name}: a call took longer than {1e3 * allowed_s:.0f} ms")
        elif found is not None:
            self._note(self._kinds.unusable, f"{name}: {found}")
        else:
            return answer
        return None

    def tell(self, name: str, message: Callable[[], None]) -> bool:
        """Tell somebody something, without a time limit; False if that raised an exception."""
        try:
            message()
        except Exception as error:  # noqa: BLE001 - it may be somebody else's and raise anything
            self._note(self._kinds.raised, f"{name}: {type(error).__name__}: {error}")
            return False
        return True

    def _note(self, kind: str, text: str) -> None:
        self.failures[kind] += 1
        self.failure = text[:LONGEST_TEXT]


def _interrupted(error: BaseException | None) -> bool:
    """Whether somebody ran out of time.

    A compiled call that is interrupted while it looks at its arguments returns as if nothing had happened.
    The interpreter then raises `SystemError` because of what interrupted it, once for each such call.
    """
    while isinstance(error, SystemError):
        error = error.__cause__
    return isinstance(error, OutOfTimeError)
