"""Promises of the benchmark that counts what the interpreter executes in a control period."""

import sys
from pathlib import Path

import pytest

from rcopterx.benchmarks import instructions
from rcopterx.ground_station.replay.recorded_agent import recorded_agent

FLIGHT = Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap"


def test_the_same_flight_costs_the_same_each_time() -> None:
    recorded = recorded_agent([FLIGHT], "h2")
    # What is loaded or kept on first use is executed once.
    instructions.counted(recorded)
    first, again = instructions.counted(recorded), instructions.counted(recorded)
    assert first.periods == again.periods > 0
    assert first.instructions.total() == pytest.approx(again.instructions.total(), rel=0.01)


def test_functions_are_told_with_their_places_and_those_that_take_most_first(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["instructions", str(FLIGHT), "h2", "--most", "5"])
    assert instructions.main() == 0
    head, _, *rows = capsys.readouterr().out.splitlines()
    assert "instructions, " in head
    assert len(rows) == 5
    numbers = [int(row.split()[0]) for row in rows]
    assert numbers == sorted(numbers, reverse=True)
    assert all(".py)" in row for row in rows)


def test_a_vehicle_that_did_not_fly_is_an_error_in_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["instructions", str(FLIGHT), "h9"])
    assert instructions.main() == 1
    assert "h9: no such vehicle" in capsys.readouterr().err
