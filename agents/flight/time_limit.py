"""How long a control step may take: asked by solvers that can stop early, enforced on all others."""

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager, nullcontext
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
    """Time of the present step; whoever has the clock provides it."""

    @abstractmethod
    def within(self, limit_s: float) -> AbstractContextManager[None]:
        """Context in which code that takes longer is ended by `OutOfTimeError`, as far as possible."""

    @abstractmethod
    def used_s(self) -> float:
        """Time that has passed since the context was entered; when it has been left, the whole."""


class NoTimeLimit(TimeLimit):
    """For experiments and replay, which take as long as they need and must not depend on the machine."""

    def within(self, limit_s: float) -> AbstractContextManager[None]:  # noqa: ARG002 - there is none
        """See `TimeLimit.within`."""
        return nullcontext()

    def used_s(self) -> float:
        """See `TimeLimit.used_s`."""
        return 0.0
