"""One process that a supervisor keeps running, and when it is started again."""

import signal
from collections import Counter
from dataclasses import dataclass, field

from rcopterx.bus.heartbeat import HeartbeatPage
from rcopterx.deploy.processes.forking import ForkedProcess
from rcopterx.deploy.processes.table import ProcessSpec
from rcopterx.deploy.watchdog.watchdog import Hung

QUICK_RESTARTS = 3
MAX_PAUSE_S = 5.0


def restart_pause_s(quick_deaths: int) -> float:
    """Pause before a restart, by the number of deaths shortly after a start in a row.

    The first few restarts are immediate, for a crash in flight; a process that cannot even start is not
    retried at full speed.
    """
    if quick_deaths < QUICK_RESTARTS:
        return 0.0
    return float(min(MAX_PAUSE_S, 0.2 * 2 ** (quick_deaths - QUICK_RESTARTS)))


@dataclass
class Child:
    """One supervised process."""

    spec: ProcessSpec
    process: ForkedProcess | None = None
    page: HeartbeatPage | None = None
    started_s: float = 0.0
    restart_at_s: float = 0.0
    restarts: int = 0
    hung: int = 0
    """How often it was ended because it made no progress."""
    quick_deaths: int = 0
    last_exit: int | None = None
    wanted: bool = True
    """Whether it shall run; may be changed at any time, from any thread."""
    take_over: bool = False
    """Whether it begins by taking over from an agent that flies its vehicle elsewhere."""
    leaving_since_s: float | None = None
    """When it was asked to end, if it was; infinite once it is killed."""
    verdict: Hung | None = None
    """Why the watchdog ended it, until that is told."""
    events: Counter[str] = field(default_factory=Counter)


def signal_name(number: int) -> str:
    """Name of a signal, as far as it has one."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
