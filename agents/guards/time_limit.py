"""How long a control step may take: asked by solvers that can stop early, enforced on all others."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Final

SOLVER_SHARE: Final = 0.4
"""Share of the control period after which a solver that can stop early does so."""
STEP_SHARE: Final = 0.6
"""Share of the control period after which a step of any controller is given up; 12 ms of 20 ms."""


class OutOfTimeError(BaseException):
    """A step took too long.

    Not an `Exception`, because the code that it interrupts may catch all of those.
    """


class TimeLimit(ABC):
    """Time of the present step; whoever has the clock provides it.

    A call is what happens between `begin` and `end`. Code that takes longer is ended by `OutOfTimeError`, as
    far as possible, which may still be raised in `end`: who catches it ends the call again.
    """

    @abstractmethod
    def begin(self, limit_s: float) -> None:
        """A call begins that may take so long."""

    @abstractmethod
    def end(self, limit_s: float) -> bool:
        """A call is over; whether it has used more time than that."""

    @abstractmethod
    def over(self, limit_s: float) -> bool:
        """Whether the present call has used more time than that."""


Overtime = tuple[int, int]
"""Number of a call in a step, and the number of the question during it from which on its time was over; 0 for
the question after the call."""


class NoTimeLimit(TimeLimit):
    """For experiments, which take as long as they need and must not depend on the machine."""

    def begin(self, limit_s: float) -> None:
        """See `TimeLimit.begin`."""

    def end(self, limit_s: float) -> bool:  # noqa: ARG002 - there is none
        """See `TimeLimit.end`."""
        return False

    def over(self, limit_s: float) -> bool:  # noqa: ARG002 - there is none
        """See `TimeLimit.over`."""
        return False


class NotedTimeLimit(TimeLimit):
    """Notes which calls of a step another limit found too long, and when.

    Parameters
    ----------
    limit
        Has the clock.

    Attributes
    ----------
    overtime
        Of the present step.
    """

    def __init__(self, limit: TimeLimit) -> None:
        self.overtime: list[Overtime] = []
        self._limit = limit
        self._calls = self._questions = 0
        self._was_over = False

    def begin_step(self) -> None:
        """Count calls anew."""
        self.overtime.clear()
        self._calls = 0

    def begin(self, limit_s: float) -> None:
        """See `TimeLimit.begin`."""
        self._calls += 1
        self._questions = 0
        self._was_over = False
        self._limit.begin(limit_s)

    def end(self, limit_s: float) -> bool:
        """See `TimeLimit.end`."""
        over = self._limit.end(limit_s)
        if over:
            self.overtime.append((self._calls, 0))
        return over

    def over(self, limit_s: float) -> bool:
        """See `TimeLimit.over`."""
        over = self._limit.over(limit_s)
        self._questions += 1
        if over and not self._was_over:
            self._was_over = True
            self.overtime.append((self._calls, self._questions))
        return over


class RepeatedTimeLimit(TimeLimit):
    """Says of every call what a `NotedTimeLimit` has noted."""

    def __init__(self) -> None:
        self._from: dict[int, int] = {}
        self._afterwards: frozenset[int] = frozenset()
        self._calls = self._questions = 0

    def begin_step(self, overtime: Iterable[Overtime]) -> None:
        """Repeat this in the next step."""
        noted = tuple(overtime)
        self._from = {call: question for call, question in noted if question}
        self._afterwards = frozenset(call for call, question in noted if not question)
        self._calls = 0

    def begin(self, limit_s: float) -> None:  # noqa: ARG002 - as long as it needs
        """See `TimeLimit.begin`."""
        self._calls += 1
        self._questions = 0

    def end(self, limit_s: float) -> bool:  # noqa: ARG002 - it was another computer's
        """See `TimeLimit.end`."""
        return self._calls in self._afterwards

    def over(self, limit_s: float) -> bool:  # noqa: ARG002 - it was another computer's
        """See `TimeLimit.over`."""
        self._questions += 1
        return self._calls in self._from and self._questions >= self._from[self._calls]
