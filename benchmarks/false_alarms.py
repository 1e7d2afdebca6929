"""False alarms of the watchdog in a long flight beside busy processes."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from rcopterx.benchmarks.programs import Show
from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.ground_station.scripting.launched import launched
from rcopterx.ground_station.scripting.waiting import NotReachedError

BUSY: Final = "while True: pass"
SHOWN_EVERY_S: Final = 60.0


def run(path: Path, seconds: float, busy: int, show: Show) -> dict[str, Any]:
    """Hover beside `busy` processes that use all the processor they get, count alarms, and land.

    Raises
    ------
    NotReachedError
        The watchdog is switched off in the fleet file.
    """
    with launched(path, record=False) as fleet:
        if fleet.launcher is None or not fleet.launcher.supervisor.watchdog_on:
            raise NotReachedError("watchdog.enabled: it is switched off")
        supervisor = fleet.launcher.supervisor
        fleet.wait_ready()
        fleet.take_off()
        begun_s = time.monotonic()
        with busy_processes(busy):
            while (flown_s := time.monotonic() - begun_s) < seconds:
                show(f"{flown_s:.0f} s: {alarms(supervisor)}")
                time.sleep(min(SHOWN_EVERY_S, max(0.0, seconds - flown_s)))
        found = alarms(supervisor)
        fleet.land()
    return {"seconds": seconds, "busy": busy, **found}


@contextmanager
def busy_processes(number: int) -> Iterator[None]:
    """Processes that use as much processor as they get."""
    started = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(number)]
    try:
        yield
    finally:
        for process in started:
            process.kill()
            process.wait()


def alarms(supervisor: Supervisor) -> dict[str, Any]:
    """Counts of the watchdog so far.

    Returns
    -------
    dict
        `hung` and `restarts` by process; `spares_hung`; `forgiven` by reason; `longest_silence_s` of a
        running process [s].
    """
    return {
        "hung": {name: child.hung for name, child in supervisor.children.items() if child.hung},
        "restarts": {name: child.restarts for name, child in supervisor.children.items() if child.restarts},
        "spares_hung": supervisor.spares_hung,
        "forgiven": supervisor.forgiven,
        "longest_silence_s": max(map(supervisor.longest_silence_s, supervisor.running()), default=0.0),
    }
