"""Predictions of recorded flights are judged by what happened, without a fit to them."""

import json
import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.flight_csv import rows_of, write_csv
from support.simulated_flight import simulated_flight
from support.vehicle_types import CRAZYFLIE
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.commands.output import write_plot
from rcopterx.control.identification.fit import identify
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.radios.crtp import FULL_THRUST
from rcopterx_studies.experiments.real_flights import (
    AHEAD_S,
    CONSTANT,
    FITTED,
    TYPE,
    draught,
    follow,
    judge,
    predict_rest,
    read_flights,
    type_model,
)

DIRECTORY = Path(os.environ.get("RCOPTERX_NANOBENCH", "../shared/data/nanobench"))
STRONG = replace(CRAZYFLIE, input_gain=(3.2, 3.2, 13.0, 46.5))


@cache
def flight(seed: int, seconds: float = 20.0) -> FlightRecording:
    one = simulated_flight(STRONG, seconds, seed=seed)
    return replace(one, battery_v=np.full(len(one.yaw_rad), 3.7))


def test_a_model_that_is_true_predicts_better_than_a_constant_velocity() -> None:
    flown = [(flight(1), STRONG)]
    known, straight = follow(flown, "extended_kalman"), follow(flown, "kalman", True)
    assert list(known.errors_m) == list(AHEAD_S)
    size = [float(np.std(errors)) for errors in known.errors_m.values()]
    assert size == sorted(size)
    assert np.std(known.errors_m[0.5]) < 0.5 * np.std(straight.errors_m[0.5])
    assert len(known.innovations_m) == len(known.normalised)
    assert len(follow(flown, "finite_difference", True).normalised) == 0


def test_draught_is_what_tilt_and_drag_do_not_explain() -> None:
    windy = flight(1)
    assert np.sqrt(draught(windy)) == pytest.approx(0.1, abs=0.08)


def test_every_flight_is_predicted_by_a_fit_to_the_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fitted_to: list[tuple[int, ...]] = []

    def noted(one: FlightRecording, model: object, *more: FlightRecording) -> object:
        fitted_to.append(tuple(len(each.yaw_rad) for each in (one, *more)))
        return known

    flights = [flight(1).part(0.0, share) for share in (0.7, 0.8, 0.9, 1.0)]
    known = identify(flight(1), CRAZYFLIE)
    monkeypatch.setattr("rcopterx_studies.experiments.real_flights.identify", noted)
    evidence = judge(flights)
    document = evidence.document()
    assert fitted_to == [(700, 900), (800, 1000)]
    errors = {name: ahead["0.5 s"]["distance_mm"] for name, ahead in document["prediction_rms"].items()}
    assert errors[FITTED] < errors[TYPE]
    assert errors[FITTED] < errors[CONSTANT]
    assert json.loads(json.dumps(document)) == document
    write_plot(evidence.draw, tmp_path / "errors.svg")
    assert all(name in (tmp_path / "errors.svg").read_text() for name in (TYPE, FITTED))


def test_parts_of_a_flight_predict_the_rest() -> None:
    document = predict_rest(flight(1, 40.0), CRAZYFLIE)
    assert list(document) == ["0 to 0.6", "0.2 to 0.8", "0.4 to 1"]
    for of_part in document.values():
        assert of_part[FITTED]["0.5 s"]["horizontal"] < min(1.0, of_part[TYPE]["0.5 s"]["horizontal"])
        assert of_part["parameters"]["pitch gain"] == pytest.approx(3.2, rel=0.3)
    assert json.loads(json.dumps(document)) == document


def test_files_that_are_no_flights_are_named(tmp_path: Path) -> None:
    for number in range(4):
        write_csv(tmp_path / f"{number}.csv", rows_of(flight(1).part(0.0, 0.2)))
    (tmp_path / "bad.csv").write_text("t,px\n")
    (tmp_path / "notes.txt").write_text("")
    flights, unusable = read_flights(tmp_path)
    assert list(flights) == ["0", "1", "2", "3"]
    assert "no column" in unusable["bad"]
    thrust = flights["0"].inputs[:, 2] * 65535 / FULL_THRUST
    np.testing.assert_allclose(thrust, flight(1).inputs[: len(thrust), 2], atol=1e-3)


def test_the_type_hovers_with_the_thrust_that_is_set() -> None:
    assert type_model(0.9).hover_input[2] == pytest.approx(0.9)
    assert type_model().hover_input[2] * 65535 == pytest.approx(60000 * CRAZYFLIE.hover_input[2])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["real-flights"], "real-flights needs a directory"),
        (["hover", "."], "others take none"),
        (["real-flights", "nowhere"], "nowhere"),
        (["real-flights", "none.csv", "--columns", "none.toml"], "none.toml"),
        (["real-flights", "docs"], "0 flights, at least 4 are needed"),
    ],
)
def test_the_command_says_what_it_lacks(arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(app, ["experiment", *arguments])
    assert result.exit_code == 2
    assert words in " ".join(result.stderr.replace("│", " ").split())


@pytest.mark.skipif(not DIRECTORY.is_dir(), reason=f"no recorded flights in {DIRECTORY}")
def test_innovations_on_real_flights_are_no_larger_than_expected() -> None:
    flights, unusable = read_flights(DIRECTORY)
    assert list(unusable) == ["B6_linear_ramp_rep1"]
    one = flights["B3_figure8_slow_rep1"]
    found = follow([(one, type_model(float(one.inputs[:, 2].mean())))], "extended_kalman")
    assert np.mean(np.square(found.normalised)) < 1.0
    assert np.std(found.errors_m[0.5]) < 0.03
