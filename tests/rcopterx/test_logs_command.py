"""Promises of `logs`: what processes logged, merged, and what there is where a name is wrong."""

from pathlib import Path

import pytest
from support.bus import own_address
from support.fleets import PAIR
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.deploy.hosts.run_directory import run_directory


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path / "run"))
    port = own_address().endpoints[0].rpartition(":")[2]
    (tmp_path / "lab.toml").write_text(f"{PAIR}\n[hosts.main]\nrouter_port = {port}\n")
    logs = run_directory("lab", None) / "log"
    (logs / "agent-h2.log").write_text("2026-11-22T03:00:02.000Z INFO second\n")
    (logs / "tracker.log").write_text("2026-11-22T03:00:01.000Z INFO first\n")
    return str(tmp_path / "lab.toml")


def test_the_logs_of_a_fleet_are_shown_merged(fleet: str) -> None:
    lines = CliRunner().invoke(app, ["logs", "-f", fleet]).stdout.splitlines()
    assert [line.split() for line in lines] == [
        ["2026-11-22T03:00:01.000Z", "tracker", "INFO", "first"],
        ["2026-11-22T03:00:02.000Z", "agent-h2", "INFO", "second"],
    ]
    (only,) = CliRunner().invoke(app, ["logs", "h2", "-f", fleet]).stdout.splitlines()
    assert only.endswith("second")


def test_a_wrong_name_is_said_with_what_there_is(fleet: str) -> None:
    result = CliRunner().invoke(app, ["logs", "h9", "-f", fleet])
    assert result.exit_code == 1
    assert "h9: no log in" in result.output
    assert "agent-h2, tracker" in result.output
