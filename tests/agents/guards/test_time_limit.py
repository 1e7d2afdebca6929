"""Promises of time limits: what one has said of the calls of a step can be noted, and said again."""

from hypothesis import given
from hypothesis import strategies as st

from rcopterx.agents.guards.time_limit import NotedTimeLimit, TimeLimit
from rcopterx_studies.replay.agent_replay import RepeatedTimeLimit

calls = st.tuples(st.integers(0, 6), st.integers(0, 8), st.booleans())
"""Questions during a call, from which of them on its time is over, and whether it is over afterwards."""


class Planned(TimeLimit):
    """Time is over from a question on, and stays so; afterwards as planned."""

    def __init__(self) -> None:
        self.from_question, self.afterwards = 0, False
        self._asked = 0

    def begin(self, limit_s: float) -> None:
        self._asked = 0

    def end(self, limit_s: float) -> bool:
        return self.afterwards

    def over(self, limit_s: float) -> bool:
        self._asked += 1
        return bool(self.from_question) and self._asked >= self.from_question


DURING, AFTERWARDS = 0.008, 0.012


def asked(limit: TimeLimit, questions: int) -> list[bool]:
    limit.begin(AFTERWARDS)
    said = [limit.over(DURING) for _ in range(questions)]
    return [*said, limit.end(AFTERWARDS)]


@given(st.lists(st.lists(calls, max_size=5), max_size=4))
def test_a_repeated_limit_says_what_the_noted_one_said(steps: list[list[tuple[int, int, bool]]]) -> None:
    planned, repeated = Planned(), RepeatedTimeLimit()
    noted = NotedTimeLimit(planned)
    for step in steps:
        noted.begin_step()
        said = []
        for questions, planned.from_question, planned.afterwards in step:
            said.append(asked(noted, questions))
        repeated.begin_step(noted.overtime)
        assert [asked(repeated, questions) for questions, _, _ in step] == said


def test_nothing_is_noted_of_calls_that_came_in_time() -> None:
    noted = NotedTimeLimit(Planned())
    noted.begin_step()
    asked(noted, 3)
    assert noted.overtime == []


def test_only_the_first_question_too_late_is_noted() -> None:
    planned = Planned()
    noted = NotedTimeLimit(planned)
    noted.begin_step()
    asked(noted, 2)
    planned.from_question, planned.afterwards = 2, True
    asked(noted, 5)
    assert noted.overtime == [(2, 2), (2, 0)]
    noted.begin_step()
    assert noted.overtime == []
