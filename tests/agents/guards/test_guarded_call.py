"""Calls that fail: what is counted under which name, and how the time limit is called."""

from collections.abc import Callable

import pytest

from rcopterx.agents.guards.time_limit import GuardedCall, NotedTimeLimit, OutOfTimeError, TimeLimit

LIMIT_S = 0.01


class OverLimit(TimeLimit):
    """Every call has taken too long."""

    def end(self, limit_s: float) -> bool:
        return limit_s < 1.0


def out_of_time() -> int:
    raise OutOfTimeError


def interrupted_in_compiled_code() -> int:
    """What the interpreter makes of a result that comes with an exception."""
    raise SystemError("<kernel> returned a result with an exception set") from OutOfTimeError()


def interrupted_twice_over() -> int:
    """The same, called by compiled code that says nothing of it either."""
    try:
        return interrupted_in_compiled_code()
    except SystemError as error:
        raise SystemError("<caller> returned a result with an exception set") from error


def broken() -> int:
    raise SystemError("something else")


@pytest.mark.parametrize("question", [out_of_time, interrupted_in_compiled_code, interrupted_twice_over])
def test_interrupted_calls_are_late_and_noted_for_a_replay(question: Callable[[], int]) -> None:
    noted = NotedTimeLimit(OverLimit())
    call = GuardedCall("solver", 0, 1.0)
    call.limit = noted
    assert call.attempt("solver", LIMIT_S, lambda _: None, question) is None
    assert call.failures == {"solver_late": 1}
    assert call.failure == "solver: a call took longer than 10 ms"
    assert noted.overtime == [(1, 0)]


def test_other_errors_of_the_interpreter_are_failures_of_the_call() -> None:
    call = GuardedCall("solver", 0, 1.0)
    assert call.attempt("solver", LIMIT_S, lambda _: None, broken) is None
    assert call.failures == {"solver_raised": 1}
    line = broken.__code__.co_firstlineno + 1
    assert call.failure == f"solver: SystemError: something else (test_guarded_call.py, line {line})"
