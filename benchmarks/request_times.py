"""Round trips of requests to agents in flight, from the call of the scripting interface to its reply."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from rcopterx.benchmarks.programs import Show
from rcopterx.bus.requests import Recall
from rcopterx.ground_station.report.statistics import percentiles
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.launched import launched

PAUSE_S: Final = 0.031
"""Between two requests; not a multiple of the control period, so that they meet every phase of it."""
SETTLE_S: Final = 3.0
"""Pause after the formation is reached, so that requests meet steady flight."""
NEAR: Final = (-0.4, -0.5, 0.0)
WIDE: Final = (-0.45, -0.5, 0.0)
BESIDE_H2: Final = (0.0, -1.0, 0.0)

Request = Callable[[Fleet, int], object]

VERBS: Final[dict[str, Request]] = {
    "recall": lambda fleet, _: fleet.session.request(fleet.file.vehicles["h1"].host, Recall(vehicle="h1")),
    "go_to": lambda fleet, number: fleet["h1"].go_to((0.05 * (number % 2), 0.0, 1.0)),
    "follow_same_leader": lambda fleet, number: fleet["h3"].follow("h1", WIDE if number % 2 else NEAR),
    "follow_other_leader": lambda fleet, number: (
        fleet["h3"].follow("h1", NEAR) if number % 2 else fleet["h3"].follow("h2", BESIDE_H2)
    ),
    "lead": lambda fleet, _: fleet["h3"].lead(),
    "tune": lambda fleet, number: fleet["h2"].tune(
        input_weights=(12.0 + 0.1 * (number % 2), 12.0, 15.0, 100.0)
    ),
}
"""Requests to the trio, by the number of the round."""


def run(path: Path, rounds: int, show: Show) -> dict[str, Any]:
    """Measure `rounds` requests of each kind on a fleet like the trio, in which h1 leads h2 and h3.

    Returns
    -------
    dict
        `rounds`, and `round_trip_ms`: percentiles by kind, and of all kinds together without `tune`, whose
        reply comes only when the new settings are in use.
    """
    times: dict[str, list[float]] = {}
    with launched(path) as fleet:
        fleet.take_off()
        fleet.wait_for_formation()
        time.sleep(SETTLE_S)
        for name, request in VERBS.items():
            show(f"{name}: {rounds} requests")
            times[name] = [_timed_ms(request, fleet, number) for number in range(rounds)]
    together = [value for name, values in times.items() if name != "tune" for value in values]
    table = {name: percentiles(values) for name, values in times.items()}
    return {"rounds": rounds, "round_trip_ms": table | {"all_but_tune": percentiles(together)}}


def _timed_ms(request: Request, fleet: Fleet, number: int) -> float:
    time.sleep(PAUSE_S)
    started_s = time.monotonic()
    request(fleet, number)
    return 1000 * (time.monotonic() - started_s)
