"""Misbehaviour from inside the processes of a fleet that flies faults.

Python imports a module of this name at the start of every process with this directory in `PYTHONPATH`. On
SIGUSR2 a process reads its orders from a file named by its process id, which
`rcopterx_studies.faults.orders` writes.
"""

import json
import os
import signal
import time
from collections.abc import Callable
from typing import Any, Final

DIRECTORY: Final = os.environ.get("RCOPTERX_FAULT_ORDERS")
_true_time_s = time.time


def _spin(seconds: float) -> None:
    """Keep the working loop, which is in the main thread, busy without progress."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        pass


def _slow(by_s: float, seconds: float) -> None:
    """Make every turn of the working loop longer."""
    from rcopterx.bus.heartbeat import Heartbeat

    beat, until_s = Heartbeat.beat, time.monotonic() + seconds

    def slow_beat(self: Heartbeat, flying: bool = False) -> None:
        if time.monotonic() < until_s:
            time.sleep(by_s)
        else:
            Heartbeat.beat = beat  # type: ignore[method-assign]
        beat(self, flying)

    Heartbeat.beat = slow_beat  # type: ignore[method-assign]


def _step_clock(offset_s: float) -> None:
    """Step the wall clock."""
    time.time = lambda: _true_time_s() + offset_s


def _impair(seconds: float, **how: Any) -> None:
    """Impair what this process publishes."""
    from rcopterx_studies.faults.impairment import Impairment, impair

    impair(Impairment(**how), seconds)


ORDERS: Final[dict[str, Callable[..., None]]] = {
    "spin": _spin,
    "slow": _slow,
    "step_clock": _step_clock,
    "impair": _impair,
}


class _Orders:
    """The orders of this process, one per line; each is carried out once."""

    def __init__(self) -> None:
        self._path = f"{DIRECTORY}/{os.getpid()}"
        self._read = 0
        signal.signal(signal.SIGUSR2, self)
        # The file shows that this process accepts orders.
        open(self._path, "a", encoding="utf-8").close()

    def __call__(self, *_: object) -> None:
        """Signal handler."""
        with open(self._path, encoding="utf-8") as file:
            lines = file.readlines()
        orders, self._read = lines[self._read :], len(lines)
        for line in orders:
            order: dict[str, Any] = json.loads(line)
            ORDERS[order.pop("order")](**order)


if DIRECTORY is not None:
    _Orders()
    # Processes of a fleet are forked; each has orders of its own.
    os.register_at_fork(after_in_child=_Orders)
