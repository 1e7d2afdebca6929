"""The matrix of flown faults grows from run to run and lists every row."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from rcopterx_studies.faults import matrix
from rcopterx_studies.faults.promise import SeenFlight
from rcopterx_studies.faults.reports import Report, not_flown, report_of
from rcopterx_studies.faults.table import FAULT_FLIGHTS

FLEW = {
    "h1": SeenFlight(100, 20.4, None, None, 41.2, ("armed",)),
    "h2": SeenFlight(100, 31.0, None, None, 39.0, ("armed",)),
}
ON_PAGE = dict.fromkeys(row.on_page for row in FAULT_FLIGHTS.values())
SAFETY = Path(__file__).parents[3] / "docs" / "safety.md"


def flown(name: str, problem: str | None = None) -> Report:
    return report_of(FAULT_FLIGHTS[name], FLEW, problem, 5.0)


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


def test_take_offs_that_share_a_row_of_the_page_show_the_largest_height_and_the_hardest_touchdown() -> None:
    rows = [row for row in FAULT_FLIGHTS.values() if row.on_page[0] == "take-off-frozen-*"]
    stood = SeenFlight(100, 2.0, None, None, 40.0, ("disarmed",), ended="disarmed")
    hopped = replace(stood, deviation_mm=130.0, touchdown_m_s=0.9)
    reports = [
        report_of(row, {"h1": replace(seen, highest_m=highest_m)}, None, 5.0)
        for row, seen, highest_m in zip(rows, (stood, hopped), (0.01, 0.13), strict=False)
    ]
    lines = matrix.markdown_of({report["name"]: report for report in reports}).splitlines()
    (line,) = [line for line in lines if "take-off-frozen" in line]
    assert line.endswith("| stays on the floor | at most 0.13 m high |  |  | 0.90 |")


def test_a_row_that_ended_early_or_was_not_flown_has_not_passed() -> None:
    assert flown("bus-loss", "no spare process")["verdict"] == "failed"
    assert report_of(FAULT_FLIGHTS["bus-loss"], {}, None, 1.0)["verdict"] == "failed"
    assert not_flown(FAULT_FLIGHTS["bus-loss"], "add --up")["verdict"] == "not flown"


def test_another_file_is_not_mistaken_for_a_report(tmp_path: Path) -> None:
    (tmp_path / matrix.REPORT_NAME).write_text(json.dumps({"name": 1}))
    with pytest.raises(ValueError, match="not a report of fault flights"):
        matrix.read_reports(tmp_path)


def test_the_matrix_takes_its_place_in_a_page(tmp_path: Path) -> None:
    matrix.write_reports([flown("bus-loss", "a | b")], tmp_path)
    page = tmp_path / "page.md"
    page.write_text(f"before\n{matrix.BEGIN}old\n{matrix.END}\nafter\n")
    matrix.main(str(tmp_path), str(page))
    lines = page.read_text().splitlines()
    assert (lines[0], lines[-1], len(lines)) == ("before", "after", 6 + len(ON_PAGE))
    assert (
        "| `bus-loss` **failed** | A tenth of all messages is lost | flies on | a / b | 31 | 41 |  |" in lines
    )
    assert "| `bus-late` | All messages are 20 ms late | flies on | not flown |  |  |  |" in lines


def test_types_have_a_column_each_in_a_matrix_of_their_own(tmp_path: Path) -> None:
    landed = FLEW | {"h2": SeenFlight(100, 1000.0, 130.0, 0.41, 3000.0, ("armed", "land", "cut"))}
    down = report_of(FAULT_FLIGHTS["radio-cable"], landed, None, 5.0)
    pairs = [name for name in FAULT_FLIGHTS if name.startswith("pair-killed-")]
    worse = report_of(
        FAULT_FLIGHTS[pairs[5]], FLEW | {"h2": replace(FLEW["h2"], deviation_mm=99.0)}, None, 5.0
    )
    matrix.write_reports([flown("bus-loss"), flown(pairs[2]), worse, down], tmp_path / "px4")
    matrix.write_reports([flown("bus-loss", "h1 on the floor")], tmp_path / "brushless")
    page = tmp_path / "page.md"
    page.write_text(f"before\n{matrix.TYPES_BEGIN}old\n{matrix.TYPES_END}\nafter\n")
    matrix.main(f"px4={tmp_path / 'px4'}", f"brushless={tmp_path / 'brushless'}", str(page))
    assert page.read_text().splitlines()[2:-2] == [
        "| fault | px4 | brushless |",
        "| --- | --- | --- |",
        "| `pair-killed-*` | 99 mm | not flown |",
        "| `bus-loss` | 31 mm | **failed** 31 mm |",
        "| `radio-cable` | 20 mm, 0.41 m/s | not flown |",
    ]


def test_a_page_without_marks_is_left_alone(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("nothing")
    with pytest.raises(SystemExit, match="the marks of the matrix are missing"):
        matrix.main(str(tmp_path), str(page))


def test_safety_page_lists_every_fault() -> None:
    table = SAFETY.read_text().partition(matrix.BEGIN)[2].partition(matrix.END)[0]
    names = [line.split("`")[1] for line in table.splitlines() if line.startswith("| `")]
    assert names == [name for name, _ in ON_PAGE]


def test_pairs_of_faults_share_a_row_of_the_page_with_the_worst_figures(tmp_path: Path) -> None:
    worse = FLEW | {"h2": replace(FLEW["h2"], deviation_mm=99.0)}
    pairs = [name for name in FAULT_FLIGHTS if name.startswith("pair-killed-")]
    reports = {name: flown(name) for name in pairs}
    reports[pairs[7]] = report_of(FAULT_FLIGHTS[pairs[7]], worse, None, 5.0)
    what = "Every process, and every process 0 to 200 ms later: SIGKILL"
    line = f"| `pair-killed-*`{{mark}} | {what} | flies on | {{outcome}} | 99 | 41 |  |\n"
    assert line.format(mark="", outcome="flies on") in matrix.markdown_of(reports)
    reports[pairs[9]] = flown(pairs[9], "h1 on the floor")
    assert line.format(mark=" **failed**", outcome="h1 on the floor") in matrix.markdown_of(reports)
