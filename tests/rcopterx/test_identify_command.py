"""`identify` from a recorded flight: what it prints, writes and refuses."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.demand import demand_matrix
from support.fleets import PAIR
from support.flight_csv import rows_of, write_csv
from support.simulated_flight import simulated_flight
from support.vehicle_types import COAXIAL, CRAZYFLIE
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.control.identification.excitation import excitation_for
from rcopterx.control.identification.recording import FlightRecording
from rcopterx.control.models.lateral import LateralSystem
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.vehicle_models import model_of
from rcopterx.vehicles.model import IDENTIFIED

PERIOD_S = 0.02


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A vehicle stronger than its type, in still air; height and heading do as their sticks ask."""
    model = replace(COAXIAL, input_gain=(2.5, *COAXIAL.input_gain[1:]))
    system, excitation = LateralSystem(model, PERIOD_S), excitation_for(model, 24.0)
    random, rows = np.random.default_rng(0), 1200
    inputs = model.hover_input + np.array([excitation.at(PERIOD_S * row) for row in range(rows)])
    state, plane, tilt = np.zeros(system.size), np.zeros((rows, 2)), np.zeros((rows, 2))
    axes, upright = np.zeros((2, 3)), np.zeros((rows, 2))
    lag_s, fade = np.array(model.lag_s[2:]), np.array(model.damping[2:])
    for row in range(rows):
        plane[row], tilt[row], upright[row] = state[:2], state[system.tilt], axes[:, 0]
        acting = inputs[max(row - 1, 0)]
        state = system.transition @ state + system.demand @ demand_matrix(model, axes[1, 0]) @ acting[:2]
        for _ in range(10):
            rate = model.b[2:] * axes[:, 2] + fade * axes[:, 1]
            pull = (acting - model.hover_input)[2:]
            axes += 0.1 * PERIOD_S * np.stack((axes[:, 1], rate, (pull - axes[:, 2]) / lag_s), axis=1)
    position = np.column_stack((plane, upright[:, 0])) + 3e-4 * random.standard_normal((rows, 3))
    path = tmp_path_factory.mktemp("flight") / "flight.npz"
    noisy = upright[:, 1] + 2e-3 * random.standard_normal(rows)
    tilt += 2e-3 * random.standard_normal((rows, 2))
    FlightRecording(model.kind, PERIOD_S, position, noisy, tilt, inputs).save(path)
    return path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text("# mine\n" + PAIR)
    return path


def identify(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["identify", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


def test_a_recorded_flight_is_fitted_drawn_and_written(flight: Path, file: Path) -> None:
    figure = file.with_suffix(".png")
    code, out, err = identify("h1", "--from", flight, "-f", file, "--plot", figure)
    assert code == 0, err
    assert "pitch gain" in out
    assert "predicted 1 s ahead" in out
    assert figure.stat().st_size > 10_000
    written = model_of(load_fleet(file), "h1")
    assert written.input_gain[0] == pytest.approx(2.5, rel=0.05)
    assert replace(written.uncertainty, tilt_damping=None) == IDENTIFIED
    assert file.read_text().startswith("# mine\n")


def test_a_dry_run_prints_and_writes_nothing(flight: Path, file: Path) -> None:
    before = file.read_text()
    code, out, err = identify("h1", "--from", flight, "-f", file, "--dry-run", "--json")
    assert code == 0, err
    document = json.loads(out)
    assert document["vehicle"] == "h1"
    assert document["model"]["input_gain"][0] == pytest.approx(2.5, rel=0.1)
    assert file.read_text() == before


def test_a_flight_that_shows_nothing_is_refused_and_nothing_is_written(
    flight: Path, file: Path, tmp_path: Path
) -> None:
    with np.load(flight) as stored:
        rows = dict(stored)
    rows["inputs"] = np.tile(COAXIAL.hover_input, (len(rows["yaw_rad"]), 1))
    np.savez(tmp_path / "still.npz", **rows)
    before = file.read_text()
    code, _, err = identify("h1", "--from", tmp_path / "still.npz", "-f", file)
    assert code == 1
    assert "error: h1: " in err
    assert file.read_text() == before


def test_wrong_files_and_vehicles_are_refused(flight: Path, file: Path, tmp_path: Path) -> None:
    code, _, err = identify("h1", "--from", tmp_path / "none.npz", "-f", file)
    assert (code, "no recording of a flight" in err) == (1, True)
    code, _, err = identify("h9", "--from", flight, "-f", file)
    assert (code, "h9" in err) == (2, True)
    code, _, err = identify("h1", "--from", flight, "-f", "trio")
    assert (code, "comes with the package" in err) == (2, True)
    code, _, err = identify("h1", "--from", flight)
    assert (code, "name the fleet file that the model goes into (-f FILE)" in err) == (2, True)


def test_flights_in_csv_files_are_fitted_together_and_written(file: Path, tmp_path: Path) -> None:
    strong = replace(CRAZYFLIE, input_gain=(3.4, *CRAZYFLIE.input_gain[1:]))
    flights = [
        replace(simulated_flight(strong, 20.0, seed=seed), battery_v=np.full(1000, 3.7)) for seed in (1, 2)
    ]
    paths = [write_csv(tmp_path / f"{index}.csv", rows_of(flight)) for index, flight in enumerate(flights)]
    arguments = ("h1", "--from", paths[0], "--from", paths[1], "-f", file)
    code, _, err = identify(*arguments)
    assert (code, "radio protocol has to be 'crazyflie'" in err) == (2, True)
    file.write_text(PAIR.replace("[vehicles.h1]\n", '[vehicles.h1]\ntype = "crazyflie"\n'))
    code, _, err = identify(*arguments)
    assert code == 0, err
    assert model_of(load_fleet(file), "h1").input_gain[0] == pytest.approx(3.4, rel=0.1)
    code, _, err = identify("h1", "--from", file.with_suffix(".csv"), "-f", file)
    assert (code, "No such file" in err) == (1, True)
    code, _, err = identify(*arguments, "--save", tmp_path / "one.npz")
    assert (code, "--save is for one flight" in err) == (2, True)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "name vehicles, or give --all"),
        (("h1", "--all"), "name vehicles, or give --all"),
        (("h1", "h2", "--save", "both.npz"), "are for one vehicle"),
        (("--all", "--from", "h1.npz"), "are for one vehicle"),
    ],
)
def test_one_vehicle_several_or_all_are_identified(arguments: tuple[str, ...], words: str) -> None:
    code, _, err = identify(*arguments)
    assert code == 2
    assert words in err
