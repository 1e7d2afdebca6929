"""How the simple schemes get their settings for helicopters."""

from pathlib import Path

import numpy as np
import pytest

from agents.controllers.pid import PidSettings
from experiments import tuning
from experiments.catalogue import save_figure
from experiments.runner import Options
from experiments.schemes import PID
from experiments.tuning import AXES, ROWS, Flown, faster, fly_candidate, judged
from simulator.conditions import HELICOPTERS


def test_candidate_hovers_and_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, at_s in {"SETTLED_S": 2.0, "STEP_S": 3.0, "RESTED_S": 6.0, "FLIGHT_S": 7.0}.items():
        monkeypatch.setattr(tuning, name, at_s)
    flown = fly_candidate(PID, HELICOPTERS, 0)
    assert not flown.failed
    assert flown.errors.shape == (100, 4)
    assert np.abs(flown.errors).max() < 0.5


def test_faster_pid_keeps_its_damping_ratio() -> None:
    usual, settings = PidSettings(), faster(PID, dict.fromkeys(AXES, 2.0)).settings
    assert settings["proportional"] == tuple(4.0 * gain for gain in usual.proportional)
    assert settings["damping"] == tuple(2.0 * gain for gain in usual.damping)
    assert settings["integral"] == tuple(8.0 * gain for gain in usual.integral)


def test_each_axis_takes_its_best_candidate_of_those_that_lose_nobody() -> None:
    def errors(horizontal: float, height: float, heading: float) -> np.ndarray:
        return np.tile([horizontal, horizontal, height, heading], (5, 1))

    row = ROWS[1]
    table = judged(
        row,
        [
            [Flown(errors(0.001, 0.001, 0.001), failed=True)],
            [Flown(errors(0.02, 0.003, 0.2), failed=False)],
            [Flown(errors(0.03, 0.002, 0.1), failed=False)],
        ],
    )
    factors = row.factors
    assert table["best_factors"] == {
        "horizontal": factors["horizontal"][1],
        "height": factors["height"][2],
        "heading": factors["heading"][2],
    }
    assert table["failed"] == {"1": 1, "2": 0, "3": 0}
    assert table["horizontal"][f"{factors['horizontal'][1]:g}"] == pytest.approx(20.0)
    assert set(table["settings"]) == {"input_weights"}


def test_every_scheme_gets_as_many_candidates(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert len({len(factors) for row in ROWS for factors in row.factors.values()}) == 1
    monkeypatch.setattr(tuning, "fly_candidate", lambda *_: Flown(np.full((3, 4), 0.01), failed=False))
    result = tuning.run(Options((0, 1), preset="helicopters"), lambda *_: None)
    assert set(result.document) == {"paper", "lqr", "pid"}
    save_figure(result, tmp_path / "tuning.png")
    assert (tmp_path / "tuning.png").stat().st_size > 10_000
