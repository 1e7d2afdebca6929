"""The solver benchmark: every contestant solves the problems it is timed on."""

import pytest

from rcopterx_studies.benchmarks import flight, solver


def test_every_installed_contestant_is_timed_and_solves_its_problems(monkeypatch: pytest.MonkeyPatch) -> None:
    """Set points with turns follow each other quickly here, so that all matrices change."""
    monkeypatch.setattr(flight, "HOLD_S", 0.1)
    monkeypatch.setattr(solver, "EVERY", 3)
    shown: list[str] = []
    result = solver.run((6,), 40, 1, shown.append)
    assert shown
    figures = result["horizons"]["6"]
    assert set(figures) | set(result["missing"]) == set(solver.CONTESTANTS)
    assert {"cascade", "cascade_lags", "paper", "osqp", "osqp_paper"} <= set(figures)
    for name, row in figures.items():
        assert row["mean_ms"] > 0
        assert row["p99_ms"] <= row["p999_ms"] <= row["max_ms"]
        assert 0 < row["hard_steps"] < 40, name
        assert row["hard_mean_ms"] <= row["hard_max_ms"] <= row["max_ms"]
        if row["error"] is not None:
            assert row["error_median"] < 1e-2, name
            assert row["error"] < 0.2, name


def test_a_missing_peer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solver, "find_spec", lambda package: None)
    result = solver.run((4,), 3, 0, lambda _: None)
    assert result["missing"] == sorted(
        name for name, contestant in solver.CONTESTANTS.items() if contestant.package is not None
    )
    assert result["horizons"]["4"]["cascade"]["error"] is None
