"""Promises of the completion in shells: commands, options, shipped fleets, vehicles that are up."""

import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.deploy.hosts.running import RunningFleet, recorded

LAB = RunningFleet("lab", "d1", None, "main", ["tcp/127.0.0.1:7447"], [], ["h1", "h2", "quad"], "")


def completed(words: str) -> list[str]:
    """What bash offers at the end of these words."""
    completion = {
        "_RCOPTERX_COMPLETE": "complete_bash",
        "COMP_WORDS": words,
        "COMP_CWORD": str(words.count(" ")),
    }
    return CliRunner().invoke(app, [], prog_name="rcopterx", env=completion).stdout.split()


def test_commands_and_options_are_completed() -> None:
    assert completed("rcopterx sta") == ["status"]
    assert completed("rcopterx top --wi") == ["--wide"]


def test_shipped_fleets_and_fleet_files_are_completed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("trial.toml", "triangle.txt", "[trio.toml"):
        (tmp_path / name).write_text("")
    assert completed("rcopterx up tri") == ["trio", "trial.toml"]
    assert completed("rcopterx status -f tri") == ["trio", "trial.toml"]
    assert completed("rcopterx up [t") == ["[trio.toml"]


def test_vehicles_of_the_fleet_that_is_up_are_completed() -> None:
    assert completed("rcopterx goto ") == []
    directory = Path(os.environ["RCOPTERX_RUN"]) / "lab"
    directory.mkdir(parents=True)
    with recorded(directory, LAB):
        assert completed("rcopterx goto h") == ["h1", "h2"]
        assert completed("rcopterx follow h2 ") == ["h1", "h2", "quad"]
        assert completed("rcopterx land h1 q") == ["quad"]
