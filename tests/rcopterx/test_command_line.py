"""The command line: help, clear errors, exit codes, no tracebacks."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from rcopterx.cli import app
from rcopterx.fleet_option import fleet_path, shipped_fleets

COMMANDS = (
    "up", "demo", "fly", "arm", "takeoff", "goto", "follow", "lead", "land", "disarm", "kill", "reset",
    "router", "simulator", "tracker", "transmitters", "agent",
)  # fmt: skip
runner = CliRunner()


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_a_help_text(command: str) -> None:
    result = runner.invoke(app, [command, "--help"])
    assert result.exit_code == 0
    assert "Usage" in result.output


@pytest.mark.parametrize(
    ("command", "unit"), [("takeoff", "metres"), ("goto", "degrees"), ("demo", "seconds")]
)
def test_numbers_on_the_command_line_tell_their_unit(command: str, unit: str) -> None:
    assert unit in runner.invoke(app, [command, "--help"]).output


@pytest.mark.parametrize("command", ["up", "demo", "arm", "land"])
def test_unknown_fleet_is_an_error_with_exit_code_2(command: str) -> None:
    arguments = [command, "nowhere.toml"] if command == "up" else [command, "--fleet", "nowhere.toml"]
    result = runner.invoke(app, arguments)
    assert result.exit_code == 2
    assert "nowhere.toml" in result.output
    assert "trio" in result.output
    assert "Traceback" not in result.output


def test_wrong_fleet_file_is_an_error_with_the_field_and_exit_code_2(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text('name = "lab"\n[bus]\nrealtime_priority = "high"\n[vehicles]\n')
    result = runner.invoke(app, ["up", str(path)])
    assert result.exit_code == 2
    assert "bus.realtime_priority" in result.output


def test_steering_a_fleet_that_is_not_up_says_so(tmp_path: Path) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(
        fleet_path("trio")
        .read_text()
        .replace('name = "trio"', 'name = "nobody"\n[hosts.main]\nrouter_port = 1')
    )
    result = runner.invoke(app, ["land", "--fleet", str(path)])
    assert result.exit_code == 1
    assert "is the fleet up?" in result.output


def test_unknown_manoeuvre_lists_the_known_ones() -> None:
    result = runner.invoke(app, ["fly", "looping"])
    assert result.exit_code == 2
    assert "paper-formation" in result.output


def test_manoeuvres_are_listed_with_their_titles() -> None:
    result = runner.invoke(app, ["fly", "--list"])
    assert result.exit_code == 0
    assert "paper-formation" in result.output


def test_shipped_fleet_is_found_by_name_and_by_its_path_in_the_source_tree() -> None:
    assert "trio" in shipped_fleets()
    assert fleet_path("trio") == shipped_fleets()["trio"]
    assert fleet_path("elsewhere/fleets/trio.toml") == shipped_fleets()["trio"]
