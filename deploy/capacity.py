"""How many vehicles a computer flies, about, measured on it while its fleet waits for take-off."""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Final

from rcopterx.deploy.background import begun_behind_others
from rcopterx.deploy.fleet_file.schema import FleetFile
from rcopterx.deploy.fleet_file.snapshot import encoded

WHOLE: Final = 3.5
"""Processor time of all processes per vehicle, in that of its control periods alone: the rest of its agent,
its part of router, gateways and simulated laboratory (`rcopterx bench cost`)."""
USABLE: Final = 0.8
"""Share of the processors beyond which control periods are missed."""
LOOK_S: Final = 0.1
LIMIT_S: Final = 120.0


def vehicles_flown(control_s: float, period_s: float, processors: int) -> int:
    """About how many vehicles a computer flies without missing control periods, at least 0.

    Parameters
    ----------
    control_s
        Processor time of a control period.
    period_s
        Control period.
    processors
        How many there are.
    """
    return int(USABLE * processors * period_s / (WHOLE * control_s))


class CapacityMeasurement:
    """Measures in a process of its own, at the lowest priority, and tells once.

    Parameters
    ----------
    fleet, vehicle
        The fleet, and which of its vehicles is counted with.
    ready
        Whether the computer has done what it does at the start.
    tell
        Called in another thread with the number of vehicles, or with the reason why it is not known.
    """

    def __init__(
        self, fleet: FleetFile, vehicle: str, ready: Callable[[], bool], tell: Callable[[int | str], None]
    ) -> None:
        self._fleet, self._vehicle, self._ready, self._tell = fleet, vehicle, ready, tell
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="capacity", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Measure no more."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ready():
            if self._stopping.wait(LOOK_S):
                return
        try:
            told = self._measured()
        except (OSError, ValueError, subprocess.SubprocessError) as error:
            told = f"how many vehicles this computer flies cannot be measured: {error}"
        if told is not None:
            self._tell(told)

    def _measured(self) -> int | str | None:
        """The number of vehicles; None if it is not wanted any more."""
        command = [sys.executable, "-m", "rcopterx.deploy.control_time", self._vehicle]
        with begun_behind_others(command) as process:
            told = self._told(process)
        if told is None:
            return None
        output, complaint = told
        if process.returncode:
            reason = complaint.decode(errors="replace").strip().rpartition("\n")[2]
            raise OSError(f"exit code {process.returncode} {reason}".strip())
        control_s = float(output)
        period_s = self._fleet.vehicles[self._vehicle].control.period_s
        return vehicles_flown(control_s, period_s, len(os.sched_getaffinity(0)))

    def _told(self, process: "subprocess.Popen[bytes]") -> tuple[bytes, bytes] | None:
        """Output and errors of a process that is given the fleet; None if it is not wanted any more."""
        given: bytes | None = encoded(self._fleet)
        for _ in range(round(LIMIT_S / LOOK_S)):
            try:
                return process.communicate(given, LOOK_S)
            except subprocess.TimeoutExpired:
                given = None
            if self._stopping.is_set():
                process.kill()
                return None
        process.kill()
        raise OSError(f"it takes more than {LIMIT_S:g} s")
