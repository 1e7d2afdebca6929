"""Promises of `replay`: the same again is said and ends well, anything else ends with exit code 1."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.commands.parsing import settings_of

FLIGHT = str(Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap")


def test_an_agent_that_does_the_same_again_ends_well(monkeypatch: pytest.MonkeyPatch) -> None:
    # The libraries of this process may use several threads, which changes last bits.
    monkeypatch.setattr("rcopterx.flights.provenance.provenance", dict)
    result = CliRunner().invoke(app, ["replay", FLIGHT, "--agent", "h1", "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["first"] is None
    shown = CliRunner().invoke(app, ["replay", FLIGHT, "--agent", "h2", "--with", "controller=pid"])
    assert "(flown with controller=pid)" in shown.stdout
    assert shown.exit_code == 0
    for word in ("control periods", "first difference after", "solution"):
        assert word in shown.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([FLIGHT, "--agent", "h9"], "no such vehicle, the flight has h1, h2"),
        (["nowhere"], "neither a file nor a flight 'nowhere'"),
        ([FLIGHT, "--agent", "h1", "--with", "horizon"], "'horizon' must look like"),
        ([FLIGHT, "--agent", "h1", "--with", "controller=magic"], "no controller is called 'magic'"),
    ],
)
def test_what_cannot_be_replayed_is_said(words: list[str], said: str) -> None:
    result = CliRunner().invoke(app, ["replay", *words], env={"COLUMNS": "200"})
    assert result.exit_code != 0
    assert said in " ".join(result.output.split())


def test_values_are_numbers_lists_or_words() -> None:
    words = ["horizon=30", "limit=.5", "weights=1,2.5", "controller=lqr", "name=a=b", "tilt=False", "x=none"]
    assert settings_of(words, "--with") == {
        "horizon": 30, "limit": 0.5, "weights": (1.0, 2.5), "controller": "lqr", "name": "a=b",
        "tilt": False, "x": None,
    }  # fmt: skip
