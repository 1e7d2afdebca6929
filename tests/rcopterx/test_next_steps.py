"""Without a command, `rcopterx` shows what to do next; every command that it names exists."""

from pathlib import Path

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.commands.next_steps import fleet_files, next_steps
from rcopterx.deploy.hosts.running import RunningFleet

UP = RunningFleet("trio", "", None, "main", [], [], ["h1", "h2"], "")


@pytest.mark.parametrize(
    ("running", "files", "words"),
    [
        ([], [], ("there is no fleet file here", "rcopterx demo")),
        ([], ["lab.toml"], ("Fleet files here: lab.toml", "rcopterx up lab.toml")),
        ([UP], ["lab.toml"], ("Fleet trio is up, with h1, h2", "rcopterx takeoff")),
    ],
)
def test_the_steps_depend_on_what_is_there(
    running: list[RunningFleet], files: list[str], words: tuple[str, str]
) -> None:
    title, steps = next_steps(running, files)
    commands = [command for command, _ in steps]
    assert words[0] in title
    assert words[1] in commands
    assert commands[-1] == "rcopterx --help"
    known = get_command(app).commands  # type: ignore[attr-defined]  # a group
    assert {command.split()[1] for command in commands[:-1]} <= known.keys()


def test_only_fleet_files_are_fleet_files(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text("[vehicles.h1]\n")
    (tmp_path / "other.toml").write_text("[tool]\n")
    (tmp_path / "broken.toml").write_text("[")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    (tmp_path / "folder.toml").mkdir()
    assert fleet_files(tmp_path) == ["lab.toml"]


def test_a_call_without_a_command_shows_the_steps(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, [])
    assert result.exit_code == 0
    assert "rcopterx demo" in result.output
