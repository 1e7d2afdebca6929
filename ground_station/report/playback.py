"""A flight in three dimensions in a report: its data as JSON, and the script that draws it."""

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rcopterx.ground_station.colours import hex_colour
from rcopterx.ground_station.events import LoggedEvent
from rcopterx.ground_station.report.document import Html
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.vehicles.state import Array

MAX_SAMPLES: Final = 3000  # samples of each vehicle; the script draws straight lines between them
SAMPLE_S: Final = 0.05

SCRIPT: Final = Path(__file__).with_name("playback.js")


def playback(
    name: str,
    figures: FlightFigures,
    vehicles: Sequence[str],
    events: Sequence[LoggedEvent],
    volume: tuple[Sequence[float], Sequence[float]],
) -> Html:
    """Element that plays a flight in 3D; `name` is unique on the page, `volume`: low and high corner [m]."""
    data = flight_data(figures, vehicles, events, volume)
    # Escaped, so that no text of the flight can end the element.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    identifier = f"playback-{name}"
    script = SCRIPT.read_text("utf-8").replace("ID", json.dumps(identifier), 1)
    speeds = "".join(f"<option{' selected' if x == 1 else ''}>{x}</option>" for x in (0.25, 0.5, 1, 2, 4, 8))
    return Html(
        f'<div id="{escape(identifier, quote=True)}"><script type="application/json">{text}</script>'
        '<canvas width="1100" height="520" style="width:100%;border:1px solid #ddd;touch-action:none">'
        "</canvas>"
        f"<p><button>Play</button> <select>{speeds}</select> times "
        f'<input type="range" min="0" max="{data["seconds"]}" step="0.05" value="0" style="width:60%"> '
        f"<output></output></p></div><script>{script}</script>"
    )


def flight_data(
    figures: FlightFigures,
    vehicles: Sequence[str],
    events: Sequence[LoggedEvent],
    volume: tuple[Sequence[float], Sequence[float]],
) -> dict[str, Any]:
    """Data of the script: positions and references at equal steps of time, events, volume."""
    period_s = figures.frame_period_s()
    spans = {name: figures.flown(name)[0] for name in vehicles}

    def wanted(name: str) -> tuple[Array, Array]:
        frames, references = figures.references(name)
        return frames, references[:, :3]

    first = figures.first_frame()
    last = max((int(frames[-1]) for frames in spans.values() if len(frames)), default=0)
    seconds = (last - first) * period_s
    step_s = max(SAMPLE_S, seconds / MAX_SAMPLES)
    samples = 1 + round(seconds / step_s)
    wanted_frames = first + np.arange(samples) * step_s / period_s
    return {
        "low": list(volume[0]),
        "high": list(volume[1]),
        "step": step_s,
        "samples": samples,
        "seconds": round(seconds, 2),
        "vehicles": [
            {
                "name": name,
                "colour": hex_colour(number),
                "flown": _sampled(*figures.flown(name), wanted_frames, step_s / period_s),
                "wanted": _sampled(*wanted(name), wanted_frames, step_s / period_s),
            }
            for number, name in enumerate(vehicles)
        ],
        "events": [
            {
                "t": round(event.time_s, 2),
                "text": f"{event.vehicle}: {event.words}",
                "alarming": event.alarming,
            }
            for event in events
        ],
    }


def _sampled(
    frames: NDArray[Any], values: NDArray[Any], wanted: NDArray[Any], step: float
) -> list[list[float] | None]:
    """The newest values at wanted frames, rounded to millimetres; None where they are unknown."""
    if not len(frames):
        return [None] * len(wanted)
    at = np.searchsorted(frames, wanted + 0.5, side="right") - 1
    rows: list[list[float] | None] = []
    for index, frame in zip(at.tolist(), wanted.tolist(), strict=True):
        known = index >= 0 and frame - float(frames[index]) <= max(25.0, 2 * step)
        rows.append([round(float(value), 3) for value in values[index]] if known else None)
    return rows
