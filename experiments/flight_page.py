"""A self-contained page about flown manoeuvres: a summary, then checks, figures and a picture of each."""

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from rcopterx.ground_station.report.document import (
    Html,
    document,
    percentile_table,
    table,
    vehicle_table,
)

PAGE_NAME: Final = "index.html"


def write_page(reports: Sequence[Mapping[str, Any]], pictures: Mapping[str, str], directory: Path) -> Path:
    """Write `index.html` into a directory, which is created if missing.

    `pictures` holds SVG elements by manoeuvre.
    """
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / PAGE_NAME
    path.write_text(page(reports, pictures), encoding="utf-8")
    return path


def page(reports: Sequence[Mapping[str, Any]], pictures: Mapping[str, str]) -> str:
    """The page as text."""
    counts = Counter(report["verdict"] for report in reports)
    summary = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    rows = [
        (
            Html(f'<a href="#{_id(report)}">{escape(report["manoeuvre"])}</a>'),
            report["title"],
            (report["verdict"], report["verdict"].split()[0]),
            _why(report),
        )
        for report in reports
    ]
    sections = [_section(report, pictures.get(report["manoeuvre"], "")) for report in reports]
    return document(
        "Flown manoeuvres",
        [
            f"<h1>Flown manoeuvres: {escape(summary)}</h1>",
            table(("manoeuvre", "what", "verdict", "why"), rows),
            *sections,
        ],
    )


def _id(report: Mapping[str, Any]) -> str:
    return escape(str(report["manoeuvre"]), quote=True)


def _why(report: Mapping[str, Any]) -> str:
    failed = [check["name"] for check in report["checks"] if not check["passed"]]
    return report["problem"] or "; ".join(failed or report["remarks"])


def _section(report: Mapping[str, Any], picture: str) -> str:
    parts = [
        f'<section id="{_id(report)}"><h2>{escape(report["manoeuvre"])}</h2>',
        f"<p>{escape(report['title'])}. {report['seconds']} s.</p>",
    ]
    if report["problem"]:
        parts.append(f'<p class="failed">{escape(report["problem"])}</p>')
    if report["checks"]:
        parts.append(
            table(
                ("check", "", "figure"),
                (
                    (
                        check["name"],
                        ("ok", "passed") if check["passed"] else ("failed", "failed"),
                        Html(f"<code>{escape(str(check['figure']))}</code>"),
                    )
                    for check in report["checks"]
                ),
            )
        )
    parts += [f"<p>{escape(remark)}</p>" for remark in report["remarks"]]
    if report["vehicles"]:
        latencies = {
            "pose to command": report["pose_to_command_ms"],
            "frame to radio": report["frame_to_radio_ms"],
        }
        parts += [
            percentile_table(latencies),
            vehicle_table(report["vehicles"]),
            picture,
            _journal(report["journal"]),
        ]
    return "\n".join([*parts, "</section>"])


def _journal(journal: Sequence[Mapping[str, Any]]) -> str:
    rows = table(("time", "what"), ((f"{line['at_s']:.2f} s", line["text"]) for line in journal))
    return f"<details><summary>What was done</summary>{rows}</details>"
