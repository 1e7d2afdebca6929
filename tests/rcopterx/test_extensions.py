"""Promises of commands that other packages add: they are found; missing ones name their package."""

from importlib.metadata import EntryPoint, EntryPoints

import pytest
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.commands import extensions

runner = CliRunner()


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> list[EntryPoint]:
    """Entry points of installed packages: at first none."""
    points: list[EntryPoint] = []
    monkeypatch.setattr(extensions, "entry_points", lambda group: EntryPoints(points).select(group=group))
    return points


@pytest.mark.parametrize(
    ("words", "command"),
    [
        (["experiment", "hover"], "experiment"),
        (["arena"], "arena"),
        (["amplification", "trio"], "amplification"),
        (["inject", "close"], "inject"),
        (["replay-tracker", "a.raw"], "replay-tracker"),
        (["bench", "solver", "--json"], "bench"),
        (["faults", "--list"], "faults"),
        (["search", "--hours", "1"], "search"),
        (["import", "crazyswarm2", "a.yaml", "a.toml"], "import"),
        (["import-skybrush", "a.skyc", "a.toml"], "import-skybrush"),
        (["new-plugin", "controller", "mine"], "new-plugin"),
        (["replay", "--agent", "h1"], "replay --agent"),
        (["replay", "--transmitter", "h1"], "replay --transmitter"),
        (["flights", "--check", "latest"], "flights --check"),
        (["flights", "--digest", "latest"], "flights --digest"),
        (["identify", "h1", "--from", "a.csv", "-f", "trio", "--dry-run"], "identify --from FILE.csv"),
    ],
)
@pytest.mark.usefixtures("installed")
def test_a_command_of_studies_that_are_not_installed_ends_with_their_name(
    words: list[str], command: str
) -> None:
    result = runner.invoke(app, words)
    wanted = f"error: rcopterx {command}: part of rcopterx-studies: pip install rcopterx-studies\n"
    assert (result.exit_code, result.stderr) == (2, wanted)


@pytest.mark.usefixtures("installed")
def test_without_studies_all_other_commands_are_there() -> None:
    listed = runner.invoke(app, ["--help"]).stdout
    assert "takeoff" in listed
    assert "arena" not in listed
    assert "hover" in runner.invoke(app, ["fly", "--list"]).stdout
    assert "No such command 'bake'" in runner.invoke(app, ["bake"]).stderr


def test_a_command_of_an_installed_package_is_listed_and_runs(installed: list[EntryPoint]) -> None:
    installed.append(EntryPoint("study", "rcopterx_studies.commands.arena:app", extensions.GROUP))
    assert "study" in runner.invoke(app, ["--help"]).stdout
    assert "figure_eight" in runner.invoke(app, ["study", "--list"]).stdout


def test_a_command_that_cannot_be_imported_is_named_with_the_reason(installed: list[EntryPoint]) -> None:
    installed.append(EntryPoint("broken", "rcopterx.no_such_module:app", extensions.GROUP))
    result = runner.invoke(app, ["broken"])
    assert result.exit_code == 1
    assert result.stderr.startswith("error: rcopterx broken (rcopterx.no_such_module:app) cannot be imported")
    listed = runner.invoke(app, ["--help"])
    assert listed.exit_code == 0
    assert "takeoff" in listed.stdout
