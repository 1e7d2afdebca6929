"""How the simple schemes get their settings for helicopters."""

from pathlib import Path

import pytest

from rcopterx.control.controllers.pid import PidSettings
from rcopterx.experiments import tuning
from rcopterx.experiments.figures import save_figure
from rcopterx.experiments.runner import Options
from rcopterx.experiments.schemes import PID, TUNED_LQR, TUNED_PAPER, TUNED_PID
from rcopterx.experiments.tuning import ROWS, Factors, faster, fly_candidate, judged
from rcopterx.simulator.conditions import HELICOPTERS


def test_candidate_hovers() -> None:
    assert 0.0 < fly_candidate(PID, 7.0, HELICOPTERS, 0) < 200.0


def test_faster_pid_keeps_its_damping_ratio() -> None:
    usual, settings = PidSettings(), faster(PID, Factors(2, 2, 2)).settings
    assert settings["proportional"] == tuple(4.0 * gain for gain in usual.proportional)
    assert settings["damping"] == tuple(2.0 * gain for gain in usual.damping)
    assert settings["integral"] == tuple(8.0 * gain for gain in usual.integral)


def test_candidate_with_the_best_worst_vehicle_is_chosen() -> None:
    row = ROWS[1]
    first, second, third, fourth = row.factors
    table = judged(
        row, {first: [30.0, 31.0], second: [10.0, 60.0], third: [20.0, 25.0], fourth: [5.0, 400.0]}
    )
    assert table["best"] == str(third)
    assert table["errors_mm"][str(second)] == {"median": 35.0, "worst": 60.0}
    assert set(table["settings"]) == {"input_weights"}


def test_flown_settings_are_among_the_candidates() -> None:
    for row, tuned in zip(ROWS, (TUNED_PAPER, TUNED_LQR, TUNED_PID), strict=True):
        assert tuned.settings in [row.made(row.scheme, factors).settings for factors in row.factors]


def test_every_scheme_gets_as_many_candidates(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert len({len(row.factors) for row in ROWS}) == 1
    monkeypatch.setattr(tuning, "fly_candidate", lambda *_, **__: 10.0)
    result = tuning.run(Options((0, 1), preset="helicopters"), lambda *_: None)
    assert set(result.document) == {"paper", "lqr", "pid"}
    save_figure(result.draw, tmp_path / "tuning.png")
    assert (tmp_path / "tuning.png").stat().st_size > 10_000
