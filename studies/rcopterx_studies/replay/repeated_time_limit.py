"""The time limit of a replayed agent, which ends calls where those of the recorded one ended."""

from collections.abc import Iterable

from rcopterx.agents.guards.time_limit import Overtime, TimeLimit


class RepeatedTimeLimit(TimeLimit):
    """Repeats in a replay what a `NotedTimeLimit` has noted."""

    def __init__(self) -> None:
        self._noted: frozenset[Overtime] = frozenset()
        self._calls = self._queries = 0
        self._over = False

    def begin_step(self, overtime: Iterable[Overtime]) -> None:
        """Repeat this overtime in the next step."""
        self._noted = frozenset(overtime)
        self._calls = 0

    def begin(self, limit_s: float) -> None:  # noqa: ARG002 - the limit of the recording applies
        """See `TimeLimit.begin`."""
        self._calls += 1
        self._queries = 0
        self._over = False

    def end(self, limit_s: float) -> bool:  # noqa: ARG002 - the limit of the recording applies
        """See `TimeLimit.end`."""
        return (self._calls, 0) in self._noted

    def over(self, limit_s: float) -> bool:  # noqa: ARG002 - the limit of the recording applies
        """See `TimeLimit.over`."""
        self._queries += 1
        self._over = self._over or (self._calls, self._queries) in self._noted
        return self._over
