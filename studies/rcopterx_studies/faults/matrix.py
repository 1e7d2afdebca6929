"""The matrix of flown faults: as a file that each run updates, as a page, and in docs/safety.md.

    python -m rcopterx_studies.faults.matrix DIRECTORY docs/safety.md

writes the matrix of a report directory into the page, and px4=DIRECTORY ... that of types, a column for each.
"""

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import groupby
from pathlib import Path
from typing import Any, Final

from rcopterx.ground_station.acceptance import pages
from rcopterx.ground_station.report.document import table
from rcopterx_studies.faults.promise import Promise
from rcopterx_studies.faults.reports import Report, not_flown, worst_of
from rcopterx_studies.faults.table import FAULT_FLIGHTS

REPORT_NAME: Final = "faults.json"
BEGIN: Final = "<!-- fault flights: begin -->\n"
END: Final = "<!-- fault flights: end -->"
TYPES_BEGIN: Final = "<!-- faults of types: begin -->\n"
TYPES_END: Final = "<!-- faults of types: end -->"
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


def markdown_of(reports: Mapping[str, Report]) -> str:
    """The matrix for docs/safety.md, with rows that were not flown."""
    lines = [_line(HEADINGS), _line(["---"] * len(HEADINGS))]
    for (name, title), rows in groupby(FAULT_FLIGHTS.values(), lambda row: row.on_page):
        first, *others = rows
        flown = [reports[row.name] for row in (first, *others) if row.name in reports]
        report = worst_of(flown or [not_flown(first, "not flown")])
        mark = " **failed**" if report["verdict"] == "failed" else ""
        lines.append(_line([f"`{name}`{mark}", title, *cells(report)[2:]]))
    return "\n".join(lines) + "\n"


def _line(words: Iterable[str]) -> str:
    return "| " + " | ".join(word.replace("|", "/") for word in words) + " |"


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


def markdown_of_types(types: Mapping[str, Mapping[str, Report]]) -> str:
    """Return the matrix of types: figures of the rows that one of them has flown."""
    lines = [_line(("fault", *types)), _line(["---"] * (1 + len(types)))]
    for (name, _), rows in groupby(FAULT_FLIGHTS, lambda row: FAULT_FLIGHTS[row].on_page):
        names = [*rows]
        flown = [[reports[row] for row in names if row in reports] for reports in types.values()]
        if any(flown):
            lines.append(_line((f"`{name}`", *map(_figures, flown))))
    return "\n".join(lines) + "\n"


def _figures(reports: list[Report]) -> str:
    """Largest deviation of vehicles that fly on, and hardest touchdown, of all flights of a row."""
    if not reports:
        return "not flown"
    report = worst_of(reports)
    *_, off_mm, _, touchdown_m_s = cells(report)
    figures = [f"{off_mm} mm"] * bool(off_mm) + [f"{touchdown_m_s} m/s"] * bool(touchdown_m_s)
    return " ".join(["**failed**"] * (report["verdict"] == "failed") + [", ".join(figures)]).rstrip()


def main(*arguments: str) -> None:
    """Write the matrix of a report directory, or of one for each of some types, into a page."""
    *directories, page = arguments
    if len(directories) == 1 and "=" not in directories[0]:
        _write_between(Path(page), BEGIN, END, markdown_of(read_reports(Path(directories[0]))))
        return
    pairs = [text.partition("=") for text in directories]
    types = {name: read_reports(Path(directory)) for name, _, directory in pairs}
    _write_between(Path(page), TYPES_BEGIN, TYPES_END, markdown_of_types(types))


def _write_between(path: Path, begin: str, end: str, text: str) -> None:
    before, found, rest = path.read_text(encoding="utf-8").partition(begin)
    _, ended, after = rest.partition(end)
    if not found or not ended:
        raise SystemExit(f"{path}: the marks of the matrix are missing")
    path.write_text(before + begin + text + end + after, encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
