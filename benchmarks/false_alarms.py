"""How often the watchdog ends a process that does not hang, in a long flight beside busy processes."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from rcopterx.deploy.processes.supervisor import Supervisor
from rcopterx.ground_station.scripting.launched import launched
from rcopterx.ground_station.scripting.waiting import NotReachedError

BUSY: Final = "while True: pass"
TOLD_EVERY_S: Final = 60.0

Tell = Callable[[str], None]


def run(path: Path, seconds: float, busy: int, tell: Tell) -> dict[str, Any]:
    """Hover, count what the watchdog does, and land.

    Parameters
    ----------
    path
        Fleet file, with a simulator.
    seconds
        Length of the flight [s].
    busy
        How many processes do nothing but use a processor meanwhile.
    tell
        Told what is going on.

    Returns
    -------
    dict
        `seconds`, `busy`, and as in `alarms`: nothing that is counted there may happen.

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
                tell(f"{flown_s:.0f} s: {alarms(supervisor)}")
                time.sleep(min(TOLD_EVERY_S, max(0.0, seconds - flown_s)))
        found = alarms(supervisor)
        fleet.land()
    return {"seconds": seconds, "busy": busy, **found}


@contextmanager
def busy_processes(number: int) -> Iterator[None]:
    """Let processes use as much processor as they get."""
    started = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(number)]
    try:
        yield
    finally:
        for process in started:
            process.kill()
            process.wait()


def alarms(supervisor: Supervisor) -> dict[str, Any]:
    """What the watchdog has done so far: processes ended, and silences that it forgave.

    Returns
    -------
    dict
        `hung` and `restarts`: how often, by process; `spares_hung`; `forgiven`: how often, by reason;
        `longest_silence_s` of a process that runs [s].
    """
    return {
        "hung": {name: child.hung for name, child in supervisor.children.items() if child.hung},
        "restarts": {name: child.restarts for name, child in supervisor.children.items() if child.restarts},
        "spares_hung": supervisor.spares_hung,
        "forgiven": supervisor.forgiven,
        "longest_silence_s": max(map(supervisor.longest_silence_s, supervisor.running()), default=0.0),
    }
