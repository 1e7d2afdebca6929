"""Parts of all reports: the HTML document, tables, and tables of figures."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final


class Html(str):
    """Text that is markup; all other texts are escaped."""

    __slots__ = ()


STYLE: Final = Path(__file__).with_name("report.css")
VEHICLE_COLUMNS: Final = (
    "vehicle", "formation error rms / max [mm]", "tracking error rms / max [mm]", "periods", "missed",
    "solve p50 / p99 [ms]", "fallbacks", "safety",
)  # fmt: skip
PERCENTILES: Final = ("p50", "p99", "max")


def document(title: str, body: Iterable[str]) -> str:
    """A self-contained HTML page."""
    return "\n".join(
        [
            "<!doctype html>",
            f'<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>',
            f"<style>{STYLE.read_text('utf-8')}</style></head><body>",
            *body,
            "</body></html>\n",
        ]
    )


def cell(value: object, style: str = "") -> Html:
    """One cell of a table."""
    shown = value if isinstance(value, Html) else escape(str(value))
    kind = f' class="{escape(style)}"' if style else ""
    return Html(f"<td{kind}>{shown}</td>")


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> Html:
    """A table; a cell is a value, or a pair of a value and its style."""
    lines = ["<table><tr>" + "".join(f"<th>{escape(text)}</th>" for text in head) + "</tr>"]
    for row in rows:
        cells = (cell(*one) if isinstance(one, tuple) else cell(one) for one in row)
        lines.append("<tr>" + "".join(cells) + "</tr>")
    return Html("\n".join([*lines, "</table>"]))


def vehicle_table(vehicles: Mapping[str, Mapping[str, Any]]) -> Html:
    """Errors, periods, solver times, fallbacks and safety of vehicles, see `FlightFigures.vehicle`."""
    rows = (
        (
            name,
            pair(figures["formation_error_mm"], "rms", "max"),
            pair(figures["tracking_error_mm"], "rms", "max"),
            figures["ticks"],
            figures["missed_ticks"],
            pair(figures["solve_ms"], "p50", "p99"),
            ", ".join(f"{kind} {count}" for kind, count in figures["fallbacks"].items()) or "none",
            "; ".join(figures["safety"]) or "none",
        )
        for name, figures in vehicles.items()
    )
    return table(VEHICLE_COLUMNS, rows)


def percentile_table(rows: Mapping[str, Mapping[str, float] | None]) -> Html:
    """Percentiles in milliseconds by label, without labels that have none."""
    known = ((label, figures) for label, figures in rows.items() if figures)
    cells = ((f"{label} [ms]", *map(figures.__getitem__, PERCENTILES)) for label, figures in known)
    return table(("", *PERCENTILES), cells)


def pair(figures: Mapping[str, float] | None, first: str, second: str) -> str:
    """Two figures of a set, or a dash without them."""
    return "-" if figures is None else f"{figures[first]:g} / {figures[second]:g}"
