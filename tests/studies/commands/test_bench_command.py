"""The command `rcopterx bench`."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rcopterx.command_line import app

runner = CliRunner()
ROW = {"mean_ms": 0.5, "p99_ms": 1.0, "p999_ms": 2.0, "max_ms": 3.0, "error": None}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What the benchmark was asked for; it answers at once."""
    calls: list[tuple[Any, ...]] = []

    def run(horizons: Sequence[int], steps: int, seed: int, progress: Any) -> dict[str, Any]:
        calls.append((tuple(horizons), steps, seed))
        progress("timing")
        return {"horizons": {str(n): {"cascade": ROW} for n in horizons}, "missing": ["piqp"]}

    monkeypatch.setattr("rcopterx_studies.benchmarks.solver.run", run)
    return calls


def test_bench_prints_the_document(asked: list[tuple[Any, ...]]) -> None:
    arguments = ["bench", "solver", "--json", "--horizons", "10,50", "--steps", "7", "--seed", "3"]
    result = runner.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert asked == [((10, 50), 7, 3)]
    assert json.loads(result.stdout)["horizons"]["50"]["cascade"]["max_ms"] == 3.0
    assert result.stderr.startswith("bench solver: ")


def test_bench_measures_the_horizons_of_the_papers_figure(asked: list[tuple[Any, ...]]) -> None:
    result = runner.invoke(app, ["bench", "solver"])
    assert asked[0][0] == (10, 18, 30, 50, 80, 110)
    assert "not installed: piqp" in result.stdout
    assert sum("cascade" in line for line in result.stdout.splitlines()) == 6


@pytest.mark.parametrize("horizons", ["1", "201", "10,10", "ten"])
def test_horizons_that_no_controller_has_are_refused(horizons: str) -> None:
    result = runner.invoke(app, ["bench", "solver", "--horizons", horizons], env={"COLUMNS": "200"})
    assert result.exit_code == 2
    assert "whole numbers" in result.stderr


def test_bench_draws_its_figure_and_refuses_one_it_cannot_write(
    asked: list[tuple[Any, ...]], tmp_path: Path
) -> None:
    figure = tmp_path / "solver.svg"
    result = runner.invoke(app, ["bench", "solver", "--plot", str(figure)])
    assert result.exit_code == 0, result.output
    assert figure.read_text(encoding="utf-8").startswith("<?xml")
    refused = runner.invoke(app, ["bench", "solver", "--plot", "figure.doc"], env={"COLUMNS": "200"})
    assert refused.exit_code == 2
    assert "allowed endings" in refused.stderr
    assert len(asked) == 1
