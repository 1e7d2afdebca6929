"""Promises of the benchmark of control periods after a pause."""

import sys
from pathlib import Path

import pytest

from rcopterx.benchmarks import cold_periods

FLIGHT = Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap"


def test_something_happens_before_every_period_and_is_not_counted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pauses = []
    monkeypatch.setattr(cold_periods.time, "sleep", pauses.append)
    monkeypatch.setattr(sys, "argv", ["cold_periods", str(FLIGHT), "h2"])
    assert cold_periods.main() == 0
    assert len(pauses) > cold_periods.SKIPPED
    assert set(pauses) == {cold_periods.PAUSE_S}
    assert "right after the other: " in capsys.readouterr().out


def test_a_vehicle_that_did_not_fly_is_an_error_in_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["cold_periods", str(FLIGHT), "h9"])
    assert cold_periods.main() == 1
    assert "h9: no such vehicle" in capsys.readouterr().err
