"""Self-contained pages about flown manoeuvres and faults: a summary, a table, and a section for each."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from rcopterx.ground_station.report.document import Html, document, table

PAGE_NAME: Final = "index.html"


def write_page(
    directory: Path, title: str, reports: Sequence[Mapping[str, Any]], overview: Html, sections: Iterable[str]
) -> Path:
    """Write `index.html` into a directory, which is created if missing."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / PAGE_NAME
    counts = Counter(report["verdict"] for report in reports)
    summary = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    text = document(title, [f"<h1>{escape(title)}: {escape(summary)}</h1>", overview, *sections])
    path.write_text(text, encoding="utf-8")
    return path


def link(name: str) -> Html:
    """Link to the section of a flight."""
    return Html(f'<a href="#{escape(name)}">{escape(name)}</a>')


def verdict(report: Mapping[str, Any]) -> tuple[str, str]:
    """Verdict of a flight, in its colour."""
    return report["verdict"], report["verdict"]


def section(name: str, report: Mapping[str, Any], duration: str, parts: Iterable[str]) -> str:
    """Section of a flight: what was flown, why it ended early, the checks, and further parts."""
    lines = [
        f'<section id="{escape(name)}"><h2>{escape(name)}</h2>',
        f"<p>{escape(report['title'])}. {escape(duration)}.</p>",
    ]
    if report["problem"]:
        lines.append(f'<p class="failed">{escape(report["problem"])}</p>')
    if report["checks"]:
        rows = (
            (
                check["name"],
                ("ok", "passed") if check["passed"] else ("failed", "failed"),
                Html(f"<code>{escape(str(check['figure']))}</code>"),
            )
            for check in report["checks"]
        )
        lines.append(table(("check", "", "figure"), rows))
    return "\n".join([*lines, *parts, "</section>"])
