"""Promises of `rcopterx amplification`: growth of errors along the formation of a fleet file."""

import json
from pathlib import Path

import pytest
from click.testing import Result
from support.bus import own_address
from support.scripted import fleet_file_text
from typer.testing import CliRunner

from rcopterx.command_line import app

BESIDE = '[[vehicles.h2.follow]]\nleader = "h1"\noffset_m = [0.0, 0.6, 0.0]\n'


def run(directory: Path, more: str, *options: str) -> Result:
    path = directory / "lab.toml"
    path.write_text(fleet_file_text(own_address()) + more)
    result = CliRunner().invoke(app, ["amplification", str(path), *options])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def test_growth_of_errors_along_a_formation_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    more = BESIDE + "[vehicles.h2.control]\ndeviation_share = 1.0\n"
    result = run(tmp_path, more, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.output)["vehicles"]
    assert found["h1"] == {"above": 0, "passed_on": 0.0, "together": pytest.approx(1.0)}
    assert found["h2"]["passed_on"] > 0.0
    limit = 0.999 * found["h2"]["together"]
    monkeypatch.setattr("rcopterx_studies.experiments.amplification.LARGEST_AMPLIFICATION", limit)
    result = run(tmp_path, more)
    assert result.exit_code == 1
    assert "h2: errors grow 1.0" in result.output


def test_growth_is_not_known_of_other_controllers(tmp_path: Path) -> None:
    result = run(tmp_path, '[vehicles.h2.control]\ncontroller = "pid"\n')
    assert result.exit_code == 0
    assert "not for pid with extended_kalman" in result.output
