"""The command `rcopterx experiment`: documents, figures, and what it says to mistakes."""

import json
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from support.conditions import HELICOPTERS
from support.squared import squared
from support.waiting import DEADLINE_S, is_running, wait_for
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx_studies.experiments.catalogue import EXPERIMENTS
from rcopterx_studies.experiments.family import FlownFamily
from rcopterx_studies.experiments.runner import Experiment, Options, fly_all

runner = CliRunner()


def test_experiments_are_listed() -> None:
    result = runner.invoke(app, ["experiment", "--list"])
    assert result.exit_code == 0
    assert [line.split()[0] for line in result.stdout.splitlines()] == [
        "hover",
        "formation",
        "chain",
        "family",
        "lever-arm",
        "fleets",
        "bound",
        "real-flights",
    ]


def test_experiments_fly_in_the_chosen_conditions() -> None:
    result = runner.invoke(app, ["experiment", "hover", "--conditions", "storm"])
    assert result.exit_code == 2
    message = " ".join(result.output.replace("│", " ").split())
    assert "known are ideal, laboratory, helicopter, helicopters" in message
    assert Options((3, 4), preset="helicopters").conditions is HELICOPTERS


def test_hover_prints_its_document_and_draws_its_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx_studies.experiments.hover.QUICK_FLIGHT_S", 5.5)
    figure = tmp_path / "hover.svg"
    result = runner.invoke(
        app,
        [
            "experiment",
            "hover",
            "--quick",
            "--seeds",
            "2",
            "--json",
            "--plot",
            str(figure),
            "--conditions",
            "laboratory",
        ],
    )
    assert result.exit_code == 0, result.output
    table: dict[str, Any] = json.loads(result.stdout)
    assert {"kunz_2013", "paper", "cascade"} <= set(table)
    for row in table.values():
        assert {"rms_mm", "mean_square_mm2"} == set(row["x"]) == set(row["y"]) == set(row["z"])
        assert {"rms_rad", "mean_square_rad2"} == set(row["yaw"])
    assert "seed 2" in result.stderr
    assert figure.read_text(encoding="utf-8").startswith("<?xml")


def seeds_flown(flights: list[Options], options: Options) -> dict[str, Any]:
    """A case that returns its seed at once."""
    flights.append(options)
    return {"case": partial(seed_of)}


def seed_of(conditions: object, seed: int, progress: object = None) -> int:
    return seed


def without_flights(flights: list[Options]) -> dict[str, Experiment[Any]]:
    return {
        name: replace(
            row,
            cases=partial(seeds_flown, flights),
            figures=lambda _, flown: {"seeds": list(flown)},
            draw=lambda _, figure: figure.subplots(),
        )
        for name, row in EXPERIMENTS.items()
    }


def test_seeds_are_consecutive_or_those_named(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Options] = []
    monkeypatch.setattr("rcopterx_studies.experiments.catalogue.EXPERIMENTS", without_flights(seen))
    for arguments in (
        ["chain", "--conditions", "laboratory"],
        ["hover", "--seeds", "9,4", "--quick", "--conditions", "laboratory"],
        ["family", "--quick", "--conditions", "helicopters"],
    ):
        assert runner.invoke(app, ["experiment", *arguments]).exit_code == 0
    assert [options.seeds for options in seen] == [(0, 1, 2), (9, 4), (100, 101)]
    assert [options.quick for options in seen] == [False, True, True]


def test_experiments_fly_first_order_plants_and_helicopters_and_keep_them_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rcopterx_studies.experiments.catalogue.EXPERIMENTS", without_flights([]))
    arguments = ["experiment", "chain", "--json", "--plot", str(tmp_path / "chain.svg")]
    result = runner.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout) == {
        "laboratory": {"case": {"seeds": [0, 1, 2]}},
        "helicopters": {"case": {"seeds": [100, 101, 102]}},
    }
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "chain_helicopters.svg",
        "chain_laboratory.svg",
    ]
    alone = runner.invoke(app, [*arguments, "--conditions", "helicopter"])
    assert json.loads(alone.stdout) == {"case": {"seeds": [0, 1, 2]}}
    assert (tmp_path / "chain.svg").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["tea"], "known are hover, formation, chain"),
        (["hover", "--seeds", "1,x"], "different whole numbers"),
        (["hover", "--seeds", "1,1"], "different whole numbers"),
        (
            ["family", "--knowledge", "default,guessed"],
            "unknown level 'guessed', known are default, learned, identified",
        ),
        (["hover", "--knowledge", "exact"], "hover does not compare it"),
        (["family", "--resume", "/nowhere/flights.jsonl"], "No such file or directory"),
        (["hover", "--plot", "figure.doc"], "allowed endings"),
        (["fleets", "--plot", "figure.png"], "fleets has no figure"),
        (["hover", "--plot", "/nowhere/figure.png"], "cannot be written"),
    ],
)
def test_mistakes_are_refused_before_anything_flies(arguments: list[str], message: str) -> None:
    result = runner.invoke(app, ["experiment", *arguments], env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exit_code == 2
    assert message in " ".join(result.stderr.replace("│", " ").split())


def test_interrupted_experiment_flies_only_what_its_file_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[int] = []

    def fly(*_: object, seed: int, **__: object) -> FlownFamily:
        flown.append(seed)
        if seed == 101 and len(flown) == 2:
            raise KeyboardInterrupt
        return FlownFamily(float(seed), 3.0, 30.0, 0.1, 0.1, 40.0, 40.0, 20.0, 40.0, 1.1, False, False, 0)

    monkeypatch.setattr("rcopterx_studies.experiments.family.fly_member", fly)
    flights = tmp_path / "flights.jsonl"
    arguments = ["family", "--seeds", "100,101", "--knowledge", "exact", "--conditions", "helicopters"]
    arguments += ["--resume", str(flights), "--json"]
    assert runner.invoke(app, ["experiment", *arguments]).exit_code != 0
    result = runner.invoke(app, ["experiment", *arguments])
    assert result.exit_code == 0, result.output
    assert flown == [100, 101, 101, 100, 101]
    table = json.loads(result.stdout)
    assert list(table) == ["exact"]
    assert table["exact"]["tilt measured"]["hover_mm"]["worst"] == 101.0


def test_flights_on_several_cores_return_in_order() -> None:
    fractions: list[float] = []
    flights = {str(number): partial(squared, number) for number in range(4)}
    for processes in (1, 2):
        options = Options((0,), processes=processes)
        flown = fly_all(flights, options, lambda _, fraction: fractions.append(fraction))
        assert list(flown.items()) == [("0", 0), ("1", 1), ("2", 4), ("3", 9)]
        assert fractions[-1] == 1.0


FLIES_LONG = """
import time
from functools import partial
from rcopterx_studies.experiments.runner import Options, fly_all
if __name__ == "__main__":
    fly_all({str(n): partial(time.sleep, 600) for n in range(2)}, Options((0,), processes=2), print)
"""


def test_workers_end_with_their_experiment(tmp_path: Path) -> None:
    script = tmp_path / "flies_long.py"
    script.write_text(FLIES_LONG)
    experiment = subprocess.Popen([sys.executable, str(script)])
    children = Path(f"/proc/{experiment.pid}/task/{experiment.pid}/children")
    try:
        # Two workers, and the process with which multiprocessing tracks its resources.
        wait_for(lambda: len(children.read_text().split()) == 3, "there are no workers")
        pids = [int(pid) for pid in children.read_text().split()]
    finally:
        experiment.terminate()
        experiment.wait(DEADLINE_S)
    wait_for(lambda: not any(map(is_running, pids)), "workers stay behind")
