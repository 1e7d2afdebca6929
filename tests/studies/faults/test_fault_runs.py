"""Several flights of a fault are reported as one, with the worst figures."""

from pathlib import Path

from rcopterx_studies.faults.laboratory_injectors import Draining
from rcopterx_studies.faults.matrix import cells, write_reports
from rcopterx_studies.faults.promise import SeenFlight
from rcopterx_studies.faults.reports import Report, report_of, worst_of
from rcopterx_studies.faults.table import FAULT_FLIGHTS


def run(deviation_mm: float, silence_ms: float, problem: str | None = None) -> Report:
    seen = {
        "h1": SeenFlight(100, deviation_mm, None, None, silence_ms, ("armed",)),
        "h2": SeenFlight(100, 10.0, None, None, 20.0, ("armed", "hold", "armed")),
    }
    return report_of(FAULT_FLIGHTS["leader-killed"], seen, problem, 5.0)


def page_of(report: Report, directory: Path) -> str:
    return write_reports([report], directory).read_text(encoding="utf-8")


def test_all_runs_that_passed_pass_with_the_worst_figures(tmp_path: Path) -> None:
    report = worst_of([run(20.0, 300.0), run(40.0, 100.0), run(30.0, 200.0)])
    assert (report["verdict"], report["runs"], report["passed"], report["seconds"]) == ("passed", 3, 3, 15.0)
    assert cells(report)[3:6] == ("flies on", "40", "300")
    assert "3 flights, 3 passed" in page_of(report, tmp_path)


def test_one_run_that_failed_fails_the_row_with_its_problem() -> None:
    report = worst_of([run(20.0, 30.0), run(200.0, 30.0), run(30.0, 30.0)])
    assert (report["verdict"], report["passed"]) == ("failed", 2)
    assert [check["name"] for check in report["checks"] if not check["passed"]] == [
        "at most 150 mm from its place"
    ]
    assert worst_of([run(20.0, 30.0, "no vehicle flew"), run(20.0, 30.0)])["problem"] == "no vehicle flew"


def test_single_run_is_reported_as_it_is(tmp_path: Path) -> None:
    report = worst_of([run(20.0, 30.0)])
    assert "1 flight," in page_of(report, tmp_path)
    assert run(20.0, 30.0).items() <= report.items()


def test_a_figure_that_was_never_seen_stays_unknown() -> None:
    assert worst_of([run(20.0, 30.0)] * 2)["vehicles"]["h1"]["touchdown_m_s"] is None


def test_a_battery_drains_in_equal_steps_to_what_is_left() -> None:
    steps = Draining("h2", 0.5, 10.0, steps=4).steps_of_battery()
    assert [step.at_s for step in steps] == [2.5, 5.0, 7.5, 10.0]
    assert [step.fault.thrust_factor for step in steps] == [0.875, 0.75, 0.625, 0.5]  # type: ignore[union-attr]
