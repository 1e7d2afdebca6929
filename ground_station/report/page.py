"""The report of a flight, and of two flights side by side."""

from collections.abc import Iterator
from html import escape
from itertools import pairwise
from typing import Final

from rcopterx.fleet.schema import FleetError
from rcopterx.flights.provenance import provenance
from rcopterx.ground_station.report.document import Html, document, percentile_table, table, vehicle_table
from rcopterx.ground_station.report.latency import STAGES, TOTAL, stage_figures
from rcopterx.ground_station.report.logged_flight import LoggedFlight
from rcopterx.ground_station.report.picture import flight_svg, formation_svg, latency_svg
from rcopterx.ground_station.report.playback import playback
from rcopterx.ground_station.terminal.margins import COLUMNS, fleet_margins, rows_of

NOTHING: Final = Html("<p>No data.</p>")


def report_page(flight: LoggedFlight) -> str:
    """Report of one flight as a self-contained page."""
    parts = [f"<section><h2>{escape(title)}</h2>{part}</section>" for title, part in sections(flight)]
    return document(f"Flight {flight.name}", [f"<h1>Flight {escape(flight.name)}</h1>", *parts])


def comparison_page(one: LoggedFlight, other: LoggedFlight) -> str:
    """Reports of two flights side by side."""
    parts = [
        f"<section><h2>{escape(title)}</h2>{_beside(left, right)}</section>"
        for (title, left), (_, right) in zip(sections(one), sections(other), strict=True)
    ]
    heads = _beside(*(f"<h1>{escape(flight.name)}</h1>" for flight in (one, other)))
    return document(f"Flights {one.name} and {other.name}", [heads, *parts])


def _beside(left: str, right: str) -> str:
    return f'<div class="beside"><div>{left}</div><div>{right}</div></div>'


def sections(flight: LoggedFlight) -> Iterator[tuple[str, Html]]:
    """Titles and contents; every flight has the same titles."""
    names, figures = list(flight.fleet.vehicles), flight.figures
    volume = (flight.fleet.volume.min_m, flight.fleet.volume.max_m)
    yield "Completeness", _completeness(flight)
    yield "Playback", playback(flight.name, figures, names, flight.events, volume)
    yield "Errors and fallbacks", vehicle_table({name: figures.vehicle(name) for name in names})
    yield "Formation", Html(formation_svg(flight.name, names, figures) or NOTHING)
    yield "Flight", Html(flight_svg(flight.name, names, figures, flight.events))
    yield "Latency by stage", _latencies(flight)
    yield "Events", _events(flight)
    yield "Margins", _margins(flight)
    yield "Identification", _identification(flight)
    yield "Provenance", _provenance(flight)


def _completeness(flight: LoggedFlight) -> Html:
    if not flight.missing:
        return Html("<p>The log is complete.</p>")
    return table(("The log is incomplete",), ([(line, "failed")] for line in flight.missing))


def _latencies(flight: LoggedFlight) -> Html:
    parts = []
    labels = {TOTAL: TOTAL} | {stage: f"{stage}: {text}" for stage, text in STAGES.items()}
    for name in flight.fleet.vehicles:
        if found := stage_figures([times_ms for _, times_ms in flight.figures.stages[name]]):
            parts += [
                f"<h3>{escape(name)}</h3>",
                percentile_table({labels[stage]: row for stage, row in found.items()}),
                latency_svg(flight.name, name, flight.figures, flight.started_s),
            ]
    return Html("\n".join(parts)) if parts else NOTHING


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
