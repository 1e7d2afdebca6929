"""Options of `up` that daemons cannot fulfil are refused before they start anything."""

from pathlib import Path

import pytest
from support.waiting import DEADLINE_S
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.deploy.hosts.running import RunningFleet, recorded
from rcopterx.fleet.reading import load_fleet


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("--no-record", "--no-record: daemons start this fleet; give the option to rcopterx host"),
        ("--no-watchdog", "--no-watchdog: daemons start this fleet; set watchdog.enabled = false"),
        ("--without=h9", "--without: unknown vehicle 'h9', known are h1, h2"),
    ],
)
def test_options_that_daemons_cannot_fulfil_are_usage_errors(
    option: str, words: str, up: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx.ground_station.scripting.daemons.ROUTER_S", DEADLINE_S)
    fleet = load_fleet(Path(up))
    namespace = fleet.bus.namespace
    record = RunningFleet(fleet.name, "", namespace, "main", [], [], [*fleet.vehicles], up)
    with recorded(run_directory(fleet.name, namespace), record):
        result = CliRunner().invoke(app, ["up", up, option])
    assert result.exit_code == 2, result.output
    assert f"error: {words}" in result.stderr
