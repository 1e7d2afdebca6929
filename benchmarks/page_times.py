"""From the start of the web page, or of its fleet as well, until the page can be used in a browser."""

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rcopterx.benchmarks.browser import browser, opened, served, started
from rcopterx.benchmarks.programs import Show
from rcopterx.compiling.cache import compile_all
from rcopterx.fleet.reading import load_fleet
from rcopterx.ground_station.report.statistics import percentiles
from rcopterx.ground_station.scripting.launched import launched


def run(path: Path, runs: int, from_start: bool, show: Show) -> dict[str, Any]:
    """Measure on the fleet of a file, on the floor, with a browser that is open already.

    Parameters
    ----------
    from_start
        Whether `rcopterx up` is started together with the page, each time; otherwise the fleet is up.

    Returns
    -------
    dict
        `vehicles`, `runs`, `from_start`, and percentiles [s]: `served_s` until the page has an address,
        `usable_s` until KILL is connected and the first vehicle is shown.
    """
    served_s, usable_s = [], []
    # Compiling the kernels is not part of the measurement.
    compile_all()
    with ExitStack() as stack:
        if not from_start:
            stack.enter_context(launched(path, record=False))
        chromium = stack.enter_context(browser())
        for number in range(runs):
            show(f"page {number + 1} of {runs}")
            began_s = time.monotonic()
            with ExitStack() as one:
                if from_start:
                    one.enter_context(started(str(path)))
                address = one.enter_context(served(str(path)))
                served_s.append(time.monotonic() - began_s)
                window = opened(chromium, address)
                usable_s.append(time.monotonic() - began_s)
                window.close()
    return {
        "vehicles": len(load_fleet(path).vehicles),
        "runs": runs,
        "from_start": from_start,
        "served_s": percentiles(served_s),
        "usable_s": percentiles(usable_s),
    }
