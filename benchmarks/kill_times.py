"""Time from KILL to the first throttle-low frame at the radio of every vehicle."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from rcopterx.agents.phases import Phase
from rcopterx.benchmarks.browser import NEEDED, browser, browser_there, opened, served
from rcopterx.benchmarks.programs import Show
from rcopterx.bus import channels
from rcopterx.ground_station.report.statistics import percentiles
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.launched import launched
from rcopterx.ground_station.scripting.vehicle import FLIGHT_ERRORS, Vehicle

READY_S: Final = 5.0
LOW_S: Final = 10.0
"""Limit within which every vehicle must be cut."""
REPEATED_S: Final = 1.2
"""A process may repeat a kill for a second after its success, which would undo a reset."""
PAUSE_S: Final = 0.033
"""Grows with the number of the press, so that presses meet every phase of the control period."""

Press = Callable[[], object]


def run(path: Path, repeats: int, show: Show) -> dict[str, Any]:
    """Measure on the fleet of a file, armed on the floor, `repeats` times each way.

    Returns
    -------
    dict
        `presses`, and `low_ms`: percentiles of the slowest vehicle of each press, by way: `script` calls
        `Fleet.kill`, `page` presses the space bar in Chromium. `page` is None without Chromium or playwright.
    """
    with launched(path, record=False) as fleet:
        written = {
            name: fleet.session.subscribe(channels.APPLIED, name, depth=256) for name in fleet.file.vehicles
        }

        def timed(way: str, press: Press) -> dict[str, float] | None:
            show(f"{way}: {repeats} presses")
            # The first one does not count: a new page is still drawing.
            _timed_ms(fleet, written, press, 0)
            return percentiles([_timed_ms(fleet, written, press, number) for number in range(repeats)])

        times = {"script": timed("script", lambda: fleet.kill(reason="benchmark")), "page": None}
        if browser_there():
            with _page(str(path)) as press:
                times["page"] = timed("page", press)
        else:
            show(f"page: needs {NEEDED}")
    return {"presses": repeats, "vehicles": len(written), "low_ms": times}


def _timed_ms(fleet: Fleet, written: dict[str, Any], press: Press, number: int) -> float:
    """Arm, press, and wait until every vehicle is cut; time of the last one."""
    # The status of an agent may be older than the kill.
    fleet.wait_until(lambda: all(map(_brought_to_rest, fleet)), READY_S, "not disarmed on the floor", written)
    fleet.arm()
    time.sleep(PAUSE_S * number % 0.5)
    for inbox in written.values():
        inbox.drain()
    pressed_s = time.monotonic()
    press()
    low_s: dict[str, float] = {}
    while len(low_s) < len(written):
        if time.monotonic() > pressed_s + LOW_S:
            raise TimeoutError(f"{sorted(set(written) - set(low_s))} not cut within {LOW_S:g} s")
        for name, inbox in written.items():
            for received in inbox.drain():
                if received.message.state == "killed":
                    low_s.setdefault(name, received.message.written_s)
        time.sleep(0.001)
    time.sleep(REPEATED_S)
    return 1000 * (max(low_s.values()) - pressed_s)


def _brought_to_rest(vehicle: Vehicle) -> bool:
    """Whether it can be armed; resets it if necessary, again after a repeated kill."""
    if vehicle.state.transmitter_state == "killed":
        # Its status may be older than the last reset, which is then refused.
        with suppress(*FLIGHT_ERRORS):
            vehicle.reset()
    return vehicle.state.phase == Phase.GROUND and vehicle.state.transmitter_state == "disarmed"


@contextmanager
def _page(fleet: str) -> Iterator[Press]:
    """The page of a fleet in a browser; yields a function that presses its space bar."""
    with served(fleet) as address, browser() as chromium:
        window = opened(chromium, address)
        window.mouse.click(100, 400)
        yield lambda: window.keyboard.press("Space")
