"""Promises of `margins`, and of the notes that `check` takes from it."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from click.testing import Result
from support.bus import own_address
from support.scripted import ScriptedVehicle, fleet_file_text
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.control.controllers.cascade.weights import default_weights
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.vehicles.model import IDENTIFIED, with_parameters

LOOSE = "[vehicles.h2.control.settings]\ninput_weights = [0.002, 0.002, 80.0, 100.0]\n"


def run(*arguments: str) -> Result:
    result = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "250", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def fleet(directory: Path, more: str = "") -> str:
    path = directory / "lab.toml"
    path.write_text(fleet_file_text(own_address()) + more)
    return str(path)


def test_default_weights_of_a_shipped_fleet_are_within_the_rule() -> None:
    result = run("margins", "trio")
    assert result.exit_code == 0, result.output
    assert result.output.count("its rule") == 9
    assert "[deg]" in result.output
    assert max(map(len, result.output.splitlines())) <= 80


def test_margins_below_the_rule_are_named_and_fail_scripts(tmp_path: Path) -> None:
    path = fleet(tmp_path, LOOSE)
    assert run("margins", path, "h1").exit_code == 0
    result = run("margins", path, "h2")
    assert result.exit_code == 1
    assert all(margin in result.output for margin in ("gain up", "delay", "corners"))
    document = json.loads(run("margins", path, "--json").output)["vehicles"]
    assert document["h1"]["axes"]["horizontal"]["below_rule"] == []
    below = document["h2"]["axes"]["horizontal"]["below_rule"]
    assert {"gain up", "delay", "corners"} <= set(below)
    horizontal = document["h2"]["axes"]["horizontal"]
    assert horizontal["delay_s"] < horizontal["rule"]["delay_s"] == 0.02


def test_of_other_controllers_margins_are_not_known(tmp_path: Path) -> None:
    path = fleet(tmp_path, '[vehicles.h2.control]\ncontroller = "pid"\n')
    result = run("margins", path, "h2")
    assert result.exit_code == 0
    assert "not for pid with extended_kalman" in result.output


@pytest.mark.parametrize(
    ("more", "vehicle", "reason"),
    [
        ("", "h9", "h9"),
        (
            "[vehicles.h2.control.settings]\ncolour = 3\n",
            "h2",
            "vehicles.h2.control: unknown setting 'colour'",
        ),
    ],
)
def test_what_cannot_be_computed_is_refused_with_the_reason(
    tmp_path: Path, more: str, vehicle: str, reason: str
) -> None:
    result = run("margins", fleet(tmp_path, more), vehicle)
    assert result.exit_code == 2
    assert reason in result.stderr


def test_check_tells_of_weights_that_were_tuned_below_the_rule(
    up: str, vehicles: dict[str, ScriptedVehicle]
) -> None:
    flown = {"controller": "cascade", "estimator": "extended_kalman"}
    vehicles["h1"].diagnostics = flown
    tuned = {"input_weights": (0.002, 0.002, 80.0, 100.0)}
    vehicles["h2"].diagnostics = flown | {"controller_settings": tuned}
    result = run("check", "-f", up, "--wait", "0.3")
    assert "note: h2: margins of horizontal below the rule" in result.output
    assert "h1" not in result.output
    assert result.exit_code == 0


def test_check_uses_the_models_that_were_identified_in_flight(
    up: str, vehicles: dict[str, ScriptedVehicle]
) -> None:
    file = load_fleet(Path(up))
    found = {"uncertainty": asdict(IDENTIFIED)}
    weights = default_weights(
        with_parameters(model_of(file, "h1"), found), file.vehicles["h1"].control.period_s
    )
    flown = {
        "controller": "cascade",
        "estimator": "extended_kalman",
        "controller_settings": {"state_weights": weights.states, "input_weights": weights.inputs},
    }
    vehicles["h1"].diagnostics = flown | {"model": found}
    vehicles["h2"].diagnostics = flown
    result = run("check", "-f", up, "--wait", "0.3")
    assert "note: h2: margins of horizontal below the rule" in result.output
    assert "h1" not in result.output
