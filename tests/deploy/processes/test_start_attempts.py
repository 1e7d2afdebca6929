"""Promises of steps whose errors end nothing."""

import pytest
from support.waiting import FakeClock

from rcopterx.deploy.processes.attempts import PAUSE_S, REPEAT_S, Attempts


def fails() -> list[str]:
    raise KeyError("pid")


def test_the_lines_of_a_step_are_passed_on() -> None:
    assert Attempts()("starting", lambda: ["one: started"]) == ["one: started"]


def test_an_error_becomes_a_line_with_its_place_and_is_repeated_after_a_while_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pauses: list[float] = []
    monkeypatch.setattr("time.sleep", pauses.append)
    clock = FakeClock()
    attempt = Attempts(clock)
    (line,) = attempt("starting", fails)
    assert line == "launcher: starting failed: KeyError: 'pid' (test_start_attempts.py, line 10); going on"
    assert attempt("starting", fails) == []
    assert attempt("stopping", fails) == [line.replace("starting", "stopping")]
    clock.advance(REPEAT_S)
    assert attempt("starting", fails) == [line]
    assert pauses == [PAUSE_S] * 4


def test_a_request_to_end_the_program_is_no_error_of_a_step() -> None:
    def interrupted() -> list[str]:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Attempts()("starting", interrupted)
