"""Matrices of flown faults in the page about safety.

    python docs/generators/fault_matrix.py DIRECTORY docs/safety.md

writes the matrix of a report directory into the page, and px4=DIRECTORY ... that of types, a column for each.
"""

import sys
from collections.abc import Iterable, Mapping
from itertools import groupby
from pathlib import Path
from typing import Final

from rcopterx_studies.faults.matrix import HEADINGS, cells, read_reports
from rcopterx_studies.faults.reports import Report, not_flown, worst_of
from rcopterx_studies.faults.table import FAULT_FLIGHTS

BEGIN: Final = "<!-- fault flights: begin -->\n"
END: Final = "<!-- fault flights: end -->"
TYPES_BEGIN: Final = "<!-- faults of types: begin -->\n"
TYPES_END: Final = "<!-- faults of types: end -->"


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
