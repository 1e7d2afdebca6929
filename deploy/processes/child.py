"""One process that a supervisor keeps running, and when it is started again."""

import signal
from dataclasses import dataclass

from rcopterx.deploy.processes.forking import ForkedProcess
from rcopterx.deploy.processes.table import ProcessSpec
from rcopterx.deploy.watchdog.watchdog import Hung

QUICK_RESTARTS = 3
MAX_PAUSE_S = 5.0


def restart_pause_s(quick_deaths: int) -> float:
    """Pause before a restart; none after the first of the deaths that came shortly after a start."""
    if quick_deaths < QUICK_RESTARTS:
        return 0.0
    return float(min(MAX_PAUSE_S, 0.2 * 2 ** (quick_deaths - QUICK_RESTARTS)))


@dataclass
class Child:
    """One supervised process."""

    spec: ProcessSpec
    process: ForkedProcess | None = None
    started_s: float = 0.0
    restart_at_s: float = 0.0  # when it is started again; 0 if no restart is due
    restarts: int = 0
    hung: int = 0  # how often it was killed because it made no progress
    quick_deaths: int = 0
    wanted: bool = True  # whether it shall run; any thread may change it at any time
    take_over: bool = False  # whether it starts by taking over from an agent that flies its vehicle elsewhere
    leaving_since_s: float | None = None  # when it received SIGTERM; infinite once it is killed
    verdict: Hung | None = None  # why the watchdog killed it, until its death is reported


def signal_name(number: int) -> str:
    """Return the name of a signal, or its number if it has no name."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
