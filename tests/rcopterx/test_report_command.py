"""Promises of `rcopterx report`: a page of one or two flights, and a reason where there is none."""

from pathlib import Path

from test_command_line import run

REFERENCE = str(Path(__file__).parents[1] / "fixtures" / "reference_flight.mcap")


def test_two_flights_are_reported_in_one_page(tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    result = run("report", REFERENCE, "--compare", REFERENCE, "-o", str(page))
    assert result.exit_code == 0, result.stderr
    assert str(page) in result.stdout
    assert page.read_text(encoding="utf-8").count("reference_flight") >= 2


def test_what_is_no_flight_log_or_cannot_be_written_is_told(tmp_path: Path) -> None:
    other = tmp_path / "other.mcap"
    other.write_text("no flight")
    result = run("report", str(other), "-o", str(tmp_path / "x.html"))
    assert result.exit_code == 1
    assert "error:" in result.stderr
    assert "not a flight log" in result.stderr
    result = run("report", REFERENCE, "-o", str(tmp_path / "nowhere" / "x.html"))
    assert result.exit_code == 1
    assert "nowhere" in result.stderr
