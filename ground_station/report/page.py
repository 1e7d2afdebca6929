"""The report of one or two flights: the page that plays them, figures above it, the rest folded below."""

from collections.abc import Callable, Mapping
from html import escape
from itertools import pairwise
from typing import Final

from rcopterx.fleet.schema import FleetError
from rcopterx.flights.provenance import provenance
from rcopterx.ground_station.page.document import saved
from rcopterx.ground_station.report.document import PERCENTILES, Html, percentile_table, table, vehicle_table
from rcopterx.ground_station.report.film import filmed
from rcopterx.ground_station.report.latency import STAGES, TOTAL, stage_figures
from rcopterx.ground_station.report.logged_flight import LoggedFlight
from rcopterx.ground_station.report.statistics import percentiles
from rcopterx.ground_station.terminal.margins import COLUMNS, fleet_margins, rows_of

MINUTE: Final = len("2026-11-22T14:15")
PLACES: Final = (
    '<details class="report" id="places"><summary>Places beside the leaders</summary><div></div></details>\n'
)


def report_page(*flights: LoggedFlight) -> str:
    """Return the report of a flight, or of several side by side, as one file that opens without a server."""
    names = " and ".join(flight.name for flight in flights)
    dates = " and ".join(flight.metadata.get("started", "")[:MINUTE].replace("T", " ") for flight in flights)
    films = [filmed(one.name, one.fleet, one.recording.records(), one.started_s) for one in flights]
    figures = f'<section class="report" id="figures">{_beside(_figures, flights)}</section>'
    folded = (
        f'<details class="report"><summary>{escape(title)}</summary>{_beside(part, flights)}</details>'
        for title, part in FOLDED.items()
    )
    return saved(
        f"Flight {names}", f"Recording of {dates}".strip(), films, figures, PLACES + "\n".join(folded)
    )


def _beside(part: Callable[[LoggedFlight], str], flights: tuple[LoggedFlight, ...]) -> str:
    return f'<div class="beside">{"".join(f"<div>{part(flight)}</div>" for flight in flights)}</div>'


def _figures(flight: LoggedFlight) -> str:
    """What the log lacks, errors and fallbacks, latencies."""
    figures = flight.figures
    lines = [f"<h2>Flight {escape(flight.name)}</h2>"]
    if flight.missing:
        lines.append(table(("The log is incomplete",), ([(line, "failed")] for line in flight.missing)))
    lines.append(vehicle_table({name: figures.vehicle(name) for name in flight.fleet.vehicles}))
    stages = {name: stage_figures(figures.stages[name]) for name in flight.fleet.vehicles}
    labels = {stage: f"{stage}: {text}" for stage, text in STAGES.items()} | {TOTAL: TOTAL}
    rows = ((label, *(_three(own.get(stage)) for own in stages.values())) for stage, label in labels.items())
    whole = {
        "pose to command": percentiles(figures.pose_to_command_ms()),
        "frame to radio": percentiles(figures.frame_to_radio_ms()),
    }
    head = ("latency, p50 / p99 / max [ms]", *stages)
    return "\n".join([*lines, f'<div class="beside">{table(head, rows)}{percentile_table(whole)}</div>'])


def _three(figures: Mapping[str, float] | None) -> str:
    return "-" if figures is None else " / ".join(f"{figures[name]:.2f}" for name in PERCENTILES)


def _events(flight: LoggedFlight) -> Html:
    rows = (
        (f"{event.time_s:.2f} s", event.vehicle, (event.words, "failed" if event.alarming else ""))
        for event in flight.events
    )
    return table(("time", "source", "event"), rows)


def _margins(flight: LoggedFlight) -> Html:
    try:
        margins = fleet_margins(flight.fleet, flight.fleet.vehicles)
    except FleetError as error:
        return Html(f"<p>{escape(str(error))}</p>")
    rows = [row for name, found in margins["vehicles"].items() for row in rows_of(name, found)]
    return Html(f"<p>As the fleet file configured the vehicles.</p>{table(COLUMNS, rows)}")


def _identification(flight: LoggedFlight) -> Html:
    rows = []
    for name in flight.fleet.vehicles:
        reported = [status.excitation for status in flight.figures.statuses[name]]
        outcomes = [after for before, after in pairwise(["", *reported]) if after != before]
        if any(outcomes):
            rows.append((name, ", then ".join(filter(None, outcomes))))
    return table(("vehicle", "excitation"), rows) if rows else Html("<p>No vehicle was identified.</p>")


def _provenance(flight: LoggedFlight) -> Html:
    page = provenance()
    rows: list[tuple[object, ...]] = [
        *flight.metadata.items(),
        ("report made by", f"rcopterx {page['rcopterx']} {page['commit']}".strip()),
    ]
    if flight.rejected:
        counts = ", ".join(f"{kind} {count}" for kind, count in flight.rejected.items())
        rows.append(("messages of another version, left out", (counts, "failed")))
    return table(("", ""), rows)


FOLDED: Final[Mapping[str, Callable[[LoggedFlight], Html]]] = {
    "Events": _events, "Margins": _margins, "Identification": _identification, "Provenance": _provenance,
}  # fmt: skip
"""Titles and contents below the page; every flight has the same."""
