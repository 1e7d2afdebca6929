"""Page about flown manoeuvres: a summary, then checks and figures of each, and a link to its flight."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from rcopterx.ground_station.acceptance import pages
from rcopterx.ground_station.acceptance.flight import reason_of
from rcopterx.ground_station.report.document import percentile_table, table, vehicle_table


def write_page(reports: Sequence[Mapping[str, Any]], flights: Mapping[str, str], directory: Path) -> Path:
    """Write `index.html` into a directory, created if missing; `flights` are pages there, by manoeuvre."""
    rows = (
        (pages.link(report["manoeuvre"]), report["title"], pages.verdict(report), reason_of(report))
        for report in reports
    )
    sections = (
        pages.section(name, report, f"{report['seconds']} s", _parts(report, flights.get(name)))
        for report in reports
        for name in [report["manoeuvre"]]
    )
    overview = table(("manoeuvre", "what", "verdict", "why"), rows)
    return pages.write_page(directory, "Flown manoeuvres", reports, overview, sections)


def _parts(report: Mapping[str, Any], flight: str | None) -> Iterator[str]:
    """Remarks; figures, flight and journal of a manoeuvre that was flown."""
    yield from (f"<p>{escape(remark)}</p>" for remark in report["remarks"])
    if report["vehicles"]:
        yield percentile_table(
            {"pose to command": report["pose_to_command_ms"], "frame to radio": report["frame_to_radio_ms"]}
        )
        yield vehicle_table(report["vehicles"])
        if flight is not None:
            yield f'<p><a href="{escape(flight)}">Play the flight</a></p>'
        steps = ((f"{line['at_s']:.2f} s", line["text"]) for line in report["journal"])
        yield f"<details><summary>What was done</summary>{table(('time', 'what'), steps)}</details>"
