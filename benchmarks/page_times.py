"""From the start of the web page of a fleet that is up until it can be used in a browser."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rcopterx.benchmarks.browser import browser, opened, served
from rcopterx.ground_station.launched import launched
from rcopterx.ground_station.statistics import percentiles


def run(path: Path, runs: int, tell: Callable[[str], None]) -> dict[str, Any]:
    """Measure on the fleet of a file, on the floor, with a browser that is open already.

    Parameters
    ----------
    path
        Fleet file.
    runs
        How often the page is started.
    tell
        Told what is going on.

    Returns
    -------
    dict
        `vehicles`, `runs`, and percentiles [s]: `served_s` until the page has an address, `usable_s` until
        KILL is connected and the first vehicle is shown.
    """
    served_s, usable_s = [], []
    with launched(path, record=False) as fleet, browser() as chromium:
        for number in range(runs):
            tell(f"page {number + 1} of {runs}")
            began_s = time.monotonic()
            with served(str(path)) as address:
                served_s.append(time.monotonic() - began_s)
                window = opened(chromium, address)
                usable_s.append(time.monotonic() - began_s)
                window.close()
        vehicles = len(fleet.file.vehicles)
    return {
        "vehicles": vehicles,
        "runs": runs,
        "served_s": percentiles(served_s),
        "usable_s": percentiles(usable_s),
    }
