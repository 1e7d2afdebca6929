"""A self-contained page about flown manoeuvres: the summary first, then checks, figures, a picture each."""

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

PAGE_NAME: Final = "index.html"
STYLE: Final = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; }
body { margin: 2rem auto; max-width: 72rem; padding: 0 1rem; }
table { border-collapse: collapse; margin: .6rem 0 1rem; }
th, td { text-align: left; padding: .2rem .8rem .2rem 0; border-bottom: 1px solid #ddd; vertical-align: top; }
.passed { color: #17702b; } .failed { color: #b3261e; font-weight: 600; } .not { color: #777; }
section { border-top: 2px solid #ddd; margin-top: 2rem; }
svg { max-width: 100%; height: auto; }
code { font-size: 90%; } details { margin: .5rem 0; }
"""


def write_page(reports: Sequence[Mapping[str, Any]], pictures: Mapping[str, str], directory: Path) -> Path:
    """Write `index.html` into a directory, which is created if missing.

    Parameters
    ----------
    reports
        Tables of the manoeuvres in the order of the page.
    pictures
        SVG elements by manoeuvre, as far as there are any.
    directory
        Where the page goes.
    """
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / PAGE_NAME
    path.write_text(page(reports, pictures), encoding="utf-8")
    return path


def page(reports: Sequence[Mapping[str, Any]], pictures: Mapping[str, str]) -> str:
    """The page as text; it refers to nothing outside itself."""
    counts = Counter(report["verdict"] for report in reports)
    summary = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    sections = [_section(report, pictures.get(report["manoeuvre"], "")) for report in reports]
    rows = [
        f'<tr><td><a href="#{_id(report)}">{escape(report["manoeuvre"])}</a></td>'
        f"<td>{escape(report['title'])}</td>{_verdict(report)}<td>{_why(report)}</td></tr>"
        for report in reports
    ]
    return "\n".join(
        [
            "<!doctype html>",
            '<html lang="en"><head><meta charset="utf-8"><title>Flown manoeuvres</title>',
            f"<style>{STYLE}</style></head><body>",
            f"<h1>Flown manoeuvres: {escape(summary)}</h1>",
            "<table><tr><th>manoeuvre</th><th>what</th><th>verdict</th><th>why</th></tr>",
            *rows,
            "</table>",
            *sections,
            "</body></html>\n",
        ]
    )


def _id(report: Mapping[str, Any]) -> str:
    return escape(str(report["manoeuvre"]), quote=True)


def _verdict(report: Mapping[str, Any]) -> str:
    verdict = str(report["verdict"])
    return f'<td class="{escape(verdict.split()[0])}">{escape(verdict)}</td>'


def _why(report: Mapping[str, Any]) -> str:
    failed = [check["name"] for check in report["checks"] if not check["passed"]]
    return escape(report["problem"] or "; ".join(failed))


def _section(report: Mapping[str, Any], picture: str) -> str:
    parts = [
        f'<section id="{_id(report)}"><h2>{escape(report["manoeuvre"])}</h2>',
        f"<p>{escape(report['title'])}. {report['seconds']} s.</p>",
    ]
    if report["problem"]:
        parts.append(f'<p class="failed">{escape(report["problem"])}</p>')
    if report["checks"]:
        parts.append("<table><tr><th>check</th><th></th><th>figure</th></tr>")
        parts += [
            f"<tr><td>{escape(check['name'])}</td>"
            f"{_judged(check['passed'])}"
            f"<td><code>{escape(str(check['figure']))}</code></td></tr>"
            for check in report["checks"]
        ]
        parts.append("</table>")
    if report["vehicles"]:
        parts += [_latencies(report), _vehicles(report["vehicles"]), picture, _journal(report["journal"])]
    return "\n".join([*parts, "</section>"])


def _judged(passed: bool) -> str:
    return '<td class="passed">ok</td>' if passed else '<td class="failed">failed</td>'


def _latencies(report: Mapping[str, Any]) -> str:
    rows = [
        f"<tr><td>{label} [ms]</td>"
        + "".join(f"<td>{figures[name]}</td>" for name in ("p50", "p99", "max"))
        + "</tr>"
        for label, figures in (
            ("pose to command", report["pose_to_command_ms"]),
            ("frame to radio", report["frame_to_radio_ms"]),
        )
        if figures
    ]
    return "\n".join(["<table><tr><th></th><th>p50</th><th>p99</th><th>max</th></tr>", *rows, "</table>"])


def _vehicles(vehicles: Mapping[str, Mapping[str, Any]]) -> str:
    head = (
        "vehicle", "formation error rms / max [mm]", "tracking error rms / max [mm]", "periods", "missed",
        "solve p50 / p99 [ms]", "fallbacks", "safety",
    )  # fmt: skip
    rows = []
    for name, table in vehicles.items():
        cells = (
            name,
            _pair(table["formation_error_mm"], "rms", "max"),
            _pair(table["tracking_error_mm"], "rms", "max"),
            table["ticks"],
            table["missed_ticks"],
            _pair(table["solve_ms"], "p50", "p99"),
            ", ".join(f"{kind} {count}" for kind, count in table["fallbacks"].items()) or "none",
            "; ".join(table["safety"]) or "none",
        )
        rows.append("<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in cells) + "</tr>")
    return "\n".join(
        ["<table><tr>" + "".join(f"<th>{escape(text)}</th>" for text in head) + "</tr>", *rows, "</table>"]
    )


def _pair(figures: Mapping[str, float] | None, first: str, second: str) -> str:
    return "-" if figures is None else f"{figures[first]:g} / {figures[second]:g}"


def _journal(journal: Sequence[Mapping[str, Any]]) -> str:
    rows = [f"<tr><td>{line['at_s']:.2f} s</td><td>{escape(line['text'])}</td></tr>" for line in journal]
    return "\n".join(["<details><summary>What was done</summary><table>", *rows, "</table></details>"])
