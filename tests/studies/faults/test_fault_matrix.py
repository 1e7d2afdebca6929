"""The matrix of flown faults grows from run to run and lists every row."""

import json
from pathlib import Path

import pytest
from support.flown_faults import FLEW, flown

from rcopterx_studies.faults import matrix
from rcopterx_studies.faults.promise import SeenFlight
from rcopterx_studies.faults.reports import not_flown, report_of
from rcopterx_studies.faults.table import FAULT_FLIGHTS


def test_rows_that_are_flown_later_join_the_earlier_ones_in_the_order_of_the_table(tmp_path: Path) -> None:
    matrix.write_reports([flown("router-spins"), flown("bus-loss")], tmp_path)
    page = matrix.write_reports([flown("leader-killed"), flown("bus-loss", "no vehicle flew <it>")], tmp_path)
    assert list(matrix.read_reports(tmp_path)) == ["leader-killed", "router-spins", "bus-loss"]
    text = page.read_text()
    assert "<h1>Flown faults: 2 passed, 1 failed</h1>" in text
    assert "no vehicle flew &lt;it&gt;" in text
    assert text.count("<section") == 3


def test_the_worst_figure_of_all_vehicles_is_in_the_matrix() -> None:
    assert matrix.cells(flown("leader-killed")) == (
        "leader-killed", "SIGKILL of agent-h1", "flies on", "flies on", "31", "41", "",
    )  # fmt: skip


def test_vehicles_that_come_down_count_for_the_touchdown_only() -> None:
    landed = FLEW | {"h2": SeenFlight(100, 1000.0, 130.0, 0.41, 3000.0, ("armed", "land", "cut"))}
    report = report_of(FAULT_FLIGHTS["follower-crash-loop"], landed, None, 5.0)
    assert report["verdict"] == "passed"
    assert matrix.cells(report)[2:] == (
        "lands closed loop: h2", "h2 down after LAND, the others fly on", "20", "41", "0.41",
    )  # fmt: skip


def test_a_row_that_ended_early_or_was_not_flown_has_not_passed() -> None:
    assert flown("bus-loss", "no spare process")["verdict"] == "failed"
    assert report_of(FAULT_FLIGHTS["bus-loss"], {}, None, 1.0)["verdict"] == "failed"
    assert not_flown(FAULT_FLIGHTS["bus-loss"], "add --up")["verdict"] == "not flown"


def test_another_file_is_not_mistaken_for_a_report(tmp_path: Path) -> None:
    (tmp_path / matrix.REPORT_NAME).write_text(json.dumps({"name": 1}))
    with pytest.raises(ValueError, match="not a report of fault flights"):
        matrix.read_reports(tmp_path)
