"""Promises of the scale benchmark: its fleets can be flown, and its verdict is that of its runs."""

from pathlib import Path
from typing import Any

import pytest

from rcopterx.deploy.fleet_check import check_fleet
from rcopterx.fleet.reading import fleet_path, load_fleet, parse_fleet
from rcopterx.ground_station.scripting.vehicle import RefusedError
from rcopterx_studies.benchmarks import scale

SERIES = scale.Series(horizon=30, seconds=1.0)


def row(vehicles: int, missed: int, p99_ms: float = 5.0, left_out: int = 0) -> dict[str, Any]:
    times = {"p50": 3.0, "p99": p99_ms, "max": 9.0}
    return {
        "vehicles": vehicles, "horizon": 30, "missed_ticks": missed, "pose_to_command_ms": times,
        "left_out_ticks": left_out, "cpu_share": dict.fromkeys(scale.ROLES, 0.1),
    }  # fmt: skip


@pytest.mark.parametrize("vehicles", [1, 2, 10, 11, 28, 40, pytest.param(100, marks=pytest.mark.campaign)])
def test_fleets_of_every_size_pass_the_checks_of_a_start(
    vehicles: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    fleet = parse_fleet(scale.fleet_text(vehicles, 20))
    assert len(fleet.vehicles) == vehicles
    check_fleet(fleet, tmp_path)


def test_the_tracker_has_the_rate_that_was_asked_for() -> None:
    fleet = parse_fleet(scale.fleet_text(3, 20, rate_hz=200.0))
    assert fleet.simulator is not None
    assert fleet.simulator.rate_hz == 200.0


@pytest.mark.parametrize(("name", "vehicles"), [("ten", 10), ("hundred", 100)])
def test_shipped_large_fleets_pass_the_checks_of_a_start(
    name: str, vehicles: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))
    fleet = load_fleet(fleet_path(name))
    assert len(fleet.vehicles) == vehicles
    check_fleet(fleet, tmp_path)


def test_the_largest_fleet_is_the_last_one_before_a_period_was_missed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    missed = {2: 0, 4: 0, 6: 3, 8: 0}
    monkeypatch.setattr(scale, "_measured", lambda vehicles, *_: row(vehicles, missed[vehicles]))
    document = scale.run((8, 2, 6, 4), SERIES, lambda _: None)
    assert document["largest_fleet"] == 4
    assert [run["vehicles"] for run in document["runs"]] == [2, 4, 6, 8]
    assert scale.run((6,), SERIES, lambda _: None)["largest_fleet"] == 0


def test_a_fleet_at_half_rate_misses_nothing_and_is_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = {2: row(2, 0), 4: row(4, 0, left_out=100)}
    monkeypatch.setattr(scale, "_measured", lambda vehicles, *_: rows[vehicles])
    assert scale.run((2, 4), SERIES, lambda _: None)["largest_fleet"] == 2


def test_a_fleet_that_cannot_be_flown_ends_the_series_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fly(vehicles: int, *_: object) -> dict[str, Any]:
        if vehicles == 4:
            raise RefusedError("h3 is held")
        return row(vehicles, 0)

    monkeypatch.setattr(scale, "_measured", fly)
    document = scale.run((2, 4, 6), SERIES, lambda _: None)
    assert document["largest_fleet"] == 2
    assert [run.get("problem") for run in document["runs"]] == [None, "h3 is held"]


def test_figure_shows_latency_and_load() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    scale.draw_scale({"seconds": 60.0, "rate_hz": 50.0, "runs": [row(2, 0), row(4, 7)]}, figure)
    assert len(figure.axes) == 2
    assert "7 missed" in [text.get_text() for text in figure.axes[0].texts]


def test_figure_without_a_fleet_that_flew_is_empty() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    failed = {"vehicles": 2, "horizon": 30, "missed_ticks": None, "pose_to_command_ms": None}
    scale.draw_scale({"seconds": 60.0, "rate_hz": 50.0, "runs": [failed]}, figure)
    assert figure.axes[0].get_title() == "N = 30, Tracker 50 Hz, 60 s each"


def test_processor_time_of_a_process_grows(tmp_path: Path) -> None:
    import os

    before_s = scale.cpu_s(os.getpid())
    while scale.cpu_s(os.getpid()) < before_s + 0.02:
        sum(range(10000))
