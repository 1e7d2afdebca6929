"""Exports a flight log in Foxglove's standard schemas."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import foxglove

from rcopterx.flights.mcap_reading import messages_of
from rcopterx.ground_station.foxglove.layout import layout_of
from rcopterx.ground_station.foxglove.view import FoxgloveView
from rcopterx.ground_station.replay.republishing import fleet_of

LAYOUT: Final = "layout.json"
FLIGHT: Final = "foxglove.mcap"


def export_foxglove(parts: Sequence[Path], directory: Path) -> list[Path]:
    """Write the flight (`foxglove.mcap`) and a layout (`layout.json`) into a directory; return the files.

    Raises FlightLogError if the flight cannot be read, and OSError if a file cannot be written.
    """
    fleet = fleet_of(parts)
    directory.mkdir(parents=True, exist_ok=True)
    flight, layout = directory / FLIGHT, directory / LAYOUT
    context = foxglove.Context()
    with foxglove.open_mcap(flight, allow_overwrite=True, context=context):
        view = FoxgloveView(fleet, context)
        for path in parts:
            for message in messages_of(path):
                unit, _, topic = message.topic.partition("/")
                view.take(unit, topic, message.payload, message.time_ns)
    layout.write_text(json.dumps(layout_of(list(fleet.vehicles)), indent=2), encoding="utf-8")
    return [flight, layout]
