"""Promises of the matrices of flown faults on the page about safety."""

from dataclasses import replace
from pathlib import Path

import pytest
from support.flown_faults import FLEW, flown

import fault_matrix
from rcopterx_studies.faults import matrix
from rcopterx_studies.faults.promise import SeenFlight
from rcopterx_studies.faults.reports import report_of
from rcopterx_studies.faults.table import FAULT_FLIGHTS

ON_PAGE = dict.fromkeys(row.on_page for row in FAULT_FLIGHTS.values())
SAFETY = Path(__file__).parents[2] / "docs" / "safety.md"


def test_take_offs_that_share_a_row_of_the_page_show_the_largest_height_and_the_hardest_touchdown() -> None:
    rows = [row for row in FAULT_FLIGHTS.values() if row.on_page[0] == "take-off-frozen-*"]
    stood = SeenFlight(100, 2.0, None, None, 40.0, ("disarmed",), ended="disarmed")
    hopped = replace(stood, deviation_mm=130.0, touchdown_m_s=0.9)
    reports = [
        report_of(row, {"h1": replace(seen, highest_m=highest_m)}, None, 5.0)
        for row, seen, highest_m in zip(rows, (stood, hopped), (0.01, 0.13), strict=False)
    ]
    lines = fault_matrix.markdown_of({report["name"]: report for report in reports}).splitlines()
    (line,) = [line for line in lines if "take-off-frozen" in line]
    assert line.endswith("| stays on the floor | at most 0.13 m high |  |  | 0.90 |")


def test_the_matrix_takes_its_place_in_a_page(tmp_path: Path) -> None:
    matrix.write_reports([flown("bus-loss", "a | b")], tmp_path)
    page = tmp_path / "page.md"
    page.write_text(f"before\n{fault_matrix.BEGIN}old\n{fault_matrix.END}\nafter\n")
    fault_matrix.main(str(tmp_path), str(page))
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
    page.write_text(f"before\n{fault_matrix.TYPES_BEGIN}old\n{fault_matrix.TYPES_END}\nafter\n")
    fault_matrix.main(f"px4={tmp_path / 'px4'}", f"brushless={tmp_path / 'brushless'}", str(page))
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
        fault_matrix.main(str(tmp_path), str(page))


def test_safety_page_lists_every_fault() -> None:
    table = SAFETY.read_text().partition(fault_matrix.BEGIN)[2].partition(fault_matrix.END)[0]
    names = [line.split("`")[1] for line in table.splitlines() if line.startswith("| `")]
    assert names == [name for name, _ in ON_PAGE]


def test_pairs_of_faults_share_a_row_of_the_page_with_the_worst_figures(tmp_path: Path) -> None:
    worse = FLEW | {"h2": replace(FLEW["h2"], deviation_mm=99.0)}
    pairs = [name for name in FAULT_FLIGHTS if name.startswith("pair-killed-")]
    reports = {name: flown(name) for name in pairs}
    reports[pairs[7]] = report_of(FAULT_FLIGHTS[pairs[7]], worse, None, 5.0)
    what = "Every process, and every process 0 to 200 ms later: SIGKILL"
    line = f"| `pair-killed-*`{{mark}} | {what} | flies on | {{outcome}} | 99 | 41 |  |\n"
    assert line.format(mark="", outcome="flies on") in fault_matrix.markdown_of(reports)
    reports[pairs[9]] = flown(pairs[9], "h1 on the floor")
    assert line.format(mark=" **failed**", outcome="h1 on the floor") in fault_matrix.markdown_of(reports)
