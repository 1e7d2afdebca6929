"""Promises of what `demo` says at its end: it fits a terminal, and judges each vehicle by its task."""

import io
from pathlib import Path

from rich.console import Console

from rcopterx.ground_station.acceptance.demonstration import CAPTION, HEADINGS, summary_table
from rcopterx.ground_station.report.logged_flight import logged_flight

REFERENCE = Path(__file__).parents[2] / "fixtures" / "reference_flight.mcap"


def test_the_summary_fits_80_columns_and_says_who_led_and_who_followed() -> None:
    flight = logged_flight("reference", [REFERENCE])
    leader, follower = flight.fleet.vehicles
    console = Console(width=80, file=io.StringIO(), record=True)
    console.print(summary_table(flight.figures, [leader, follower], 45.0))
    lines = [line.rstrip() for line in console.export_text().splitlines()]
    assert max(map(len, lines)) <= 80
    text = "\n".join(lines)
    assert "flown for 45 s" in text
    assert all(part in text for heading in HEADINGS for part in heading.split("\n"))
    assert all(part in text for part in CAPTION.split("\n"))
    row = {line.split()[0]: line for line in lines if line}
    assert " leads " in row[leader]
    assert f" follows {leader} " in row[follower]
    assert " of " in row[follower]
