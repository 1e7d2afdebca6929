"""An excitation is added for its time, and ends as soon as something is wrong with the flight."""

import numpy as np
import pytest

from rcopterx.control.identification.excitation import DONE, UNDER_WAY, Excitation, Exciter

PLACE_M = np.array([0.1, 0.2, 1.0])
EXCITATION = Excitation((0.1, 0.1, 0.02, 0.05), 30.0)


@pytest.fixture
def exciter() -> Exciter:
    exciter = Exciter()
    exciter.begin(EXCITATION, PLACE_M, 0.3, time_s=5.0)
    return exciter


def watch(
    exciter: Exciter, time_s: float = 15.0, away_m: float = 0.0, blind_s: float = 0.0, flying: bool = True
) -> str:
    exciter.watch(time_s, PLACE_M + np.array([0.0, away_m, 0.0]), blind_s, flying)
    return exciter.outcome


def test_it_is_added_to_present_and_coming_inputs(exciter: Exciter) -> None:
    inputs = np.full((3, 4), 0.5)
    added = exciter.added(inputs, 15.0, 0.02)
    for row in range(3):
        assert added[row] == pytest.approx(0.5 + EXCITATION.at(10.0 + 0.02 * row))


def test_it_ends_after_its_time(exciter: Exciter) -> None:
    assert watch(exciter, time_s=34.9) == UNDER_WAY
    assert exciter.left_s(34.9) == pytest.approx(0.1)
    assert watch(exciter, time_s=35.0) == DONE
    assert exciter.left_s(35.0) == 0.0


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ({"away_m": 0.31}, "0.31 m from its place, at most 0.3 m are allowed"),
        ({"blind_s": 0.12}, "no pose for 0.12 s"),
        ({"flying": False}, "the vehicle does not fly freely any more"),
    ],
)
def test_it_stops_at_once_when_something_is_wrong(
    exciter: Exciter, what: dict[str, float], words: str
) -> None:
    assert watch(exciter) == UNDER_WAY
    assert watch(exciter, **what) == words  # type: ignore[arg-type]  # bool and float by name
    inputs = np.zeros((2, 4))
    assert not exciter.added(inputs, 15.1, 0.02).any()


def test_the_first_reason_stays(exciter: Exciter) -> None:
    watch(exciter, away_m=1.0)
    assert "1.00 m" in watch(exciter, flying=False)


def test_nothing_happens_without_an_excitation() -> None:
    exciter = Exciter()
    assert watch(exciter, away_m=9.0) == ""
    exciter.end("never begun")
    assert exciter.outcome == ""
