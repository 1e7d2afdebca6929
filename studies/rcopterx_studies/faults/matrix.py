"""The matrix of flown faults: as a file that each run updates, and as a page."""

import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from rcopterx.ground_station.acceptance import pages
from rcopterx.ground_station.report.document import table
from rcopterx_studies.faults.promise import Promise
from rcopterx_studies.faults.reports import Report
from rcopterx_studies.faults.table import FAULT_FLIGHTS

REPORT_NAME: Final = "faults.json"
HEADINGS: Final = (
    "fault", "what is done", "promise", "seen", "off its place, at most [mm]",
    "without a fresh command, at most [ms]", "touchdown, at most [m/s]",
)  # fmt: skip


def read_reports(directory: Path) -> dict[str, Report]:
    """Reports of flown rows in the order of the table; `ValueError`: no report of fault flights."""
    path = directory / REPORT_NAME
    if not path.exists():
        return {}
    try:
        rows = {report["name"]: report for report in json.loads(path.read_text(encoding="utf-8"))}
    except (ValueError, TypeError, KeyError):
        raise ValueError(f"{path}: not a report of fault flights") from None
    return {name: rows[name] for name in FAULT_FLIGHTS if name in rows}


def write_reports(reports: Iterable[Report], directory: Path) -> Path:
    """Write reports and their page into a directory, where earlier rows stay; returns the page."""
    directory.mkdir(parents=True, exist_ok=True)
    rows = {**read_reports(directory), **{report["name"]: report for report in reports}}
    ordered = [rows[name] for name in FAULT_FLIGHTS if name in rows]
    (directory / REPORT_NAME).write_text(json.dumps(ordered, indent=2) + "\n", encoding="utf-8")
    return _write_page(ordered, directory)


def cells(report: Report) -> tuple[str, ...]:
    """A row of the matrix, one cell for each of `HEADINGS`."""
    down = ", ".join(report["down"])
    promise = report["promise"] + (f": {down}" if down else "")
    seen = report["seen"]
    flying = {name: one for name, one in report["vehicles"].items() if name not in report["down"]}
    if flying and report["promise"] == Promise.STAYS_DOWN.value:
        seen, flying = f"at most {_largest(flying, 'highest_m', 2)} m high", {}
    return (
        report["name"],
        report["title"],
        promise,
        report["problem"] or seen,
        _largest(flying, "deviation_mm", 0),
        _largest(flying, "silence_ms", 0),
        _largest(report["vehicles"], "touchdown_m_s", 2),
    )


def _largest(vehicles: Mapping[str, Mapping[str, Any]], figure: str, digits: int) -> str:
    figures = [seen[figure] for seen in vehicles.values() if seen[figure] is not None]
    return f"{max(figures):.{digits}f}" if figures else ""


def _write_page(reports: Sequence[Report], directory: Path) -> Path:
    """Write the matrix as a page."""
    rows = ((pages.verdict(report), pages.link(report["name"]), *cells(report)[1:]) for report in reports)
    sections = (
        pages.section(report["name"], report, f"{_runs(report)}, {report['seconds']} s", _arbiters(report))
        for report in reports
    )
    return pages.write_page(directory, "Flown faults", reports, table(("verdict", *HEADINGS), rows), sections)


def _arbiters(report: Report) -> list[str]:
    states = "; ".join(f"{name}: {', '.join(seen['arbiter'])}" for name, seen in report["vehicles"].items())
    return [f"<p>States of the arbiters: {escape(states)}.</p>"]


def _runs(report: Report) -> str:
    runs = report.get("runs", 1)
    return "1 flight" if runs == 1 else f"{runs} flights, {report['passed']} passed"
