"""Promises of the comparison of two checkouts: medians, ratios, and a reason where none can be measured."""

import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rcopterx.benchmarks.cost import FIGURES, CostError, compared, descendants, figures, memory_of, run
from rcopterx.command_line import app


def row(value: float) -> dict[str, float]:
    return dict.fromkeys(FIGURES, value)


def test_ratios_are_those_of_the_medians() -> None:
    document = compared([row(1.0), row(9.0), row(2.0)], [row(4.0), row(4.0), row(100.0)])
    assert document["here"]["p99_ms"] == 2.0
    assert document["there"]["p99_ms"] == 4.0
    assert set(document["ratio"].values()) == {0.5}


def test_there_is_no_ratio_to_zero() -> None:
    assert compared([row(1.0)], [row(0.0)])["ratio"]["missed_ticks"] is None


def test_loads_are_per_vehicle() -> None:
    found = figures(
        {
            "vehicles": 3,
            "missed_ticks": 2,
            "cpu_share": {"agent": 0.6, "router": 0.15},
            "pose_to_command_ms": {"p50": 2.0, "p99": 5.0, "max": 9.0},
        },
        memory_mb=100.0,
    )
    assert found["total_share"] == pytest.approx(0.25)
    assert found["agent_share"] == pytest.approx(0.2)
    assert (found["missed_ticks"], found["p99_ms"], found["memory_mb"]) == (2, 5.0, 100.0)


def test_a_fleet_that_did_not_fly_is_told_with_its_problem() -> None:
    with pytest.raises(CostError, match="no pose of h2"):
        figures({"vehicles": 2, "missed_ticks": None, "problem": "no pose of h2"}, 0.0)


def test_a_directory_that_is_no_checkout_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CostError, match="no checkout"):
        run(tmp_path, 3, 30, 1.0, 1, lambda _: pytest.fail("nothing is flown"))
    result = CliRunner().invoke(app, ["bench", "cost", "--against", str(tmp_path)])
    assert result.exit_code == 1
    assert "no checkout" in result.output


def played(proc: Path, process: int, parent: int, pss_kb: int) -> None:
    directory = proc / str(process)
    directory.mkdir()
    (directory / "stat").write_text(f"{process} (a (strange) name) S {parent} 1 1")
    (directory / "smaps_rollup").write_text(f"Rss: 99999 kB\nPss: {pss_kb} kB\nPss_Anon: 1 kB\n")


def test_grandchildren_count_and_strangers_do_not(tmp_path: Path) -> None:
    for process, parent in ((10, 1), (11, 10), (12, 11), (20, 1)):
        played(tmp_path, process, parent, 500)
    played(tmp_path, 10_000, 12, 500)
    (tmp_path / "10000" / "stat").unlink()
    (tmp_path / "self").symlink_to(tmp_path / "10")
    assert sorted(descendants(10, tmp_path)) == [11, 12]
    assert memory_of([11, 12, 99], tmp_path) == pytest.approx(1.0)


def test_this_process_is_a_descendant_of_its_parent() -> None:
    assert os.getpid() in descendants(os.getppid())
    assert memory_of([os.getpid()]) > 1.0
