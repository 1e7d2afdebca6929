"""Fleets whose processes take turns in the process of a test: the same objects, no start of processes."""

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

from integration_support import Flying

from rcopterx.bus.session import RawMessage
from rcopterx.deploy.hosts.launcher import Launcher
from rcopterx.fleet.reading import at_speed, parse_fleet
from rcopterx.ground_station.report.recorder import FlightSampler
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx_studies.faults.flight_promises import NEEDED
from rcopterx_studies.search.one_process import in_one_process


class FlyingInOneProcess(Flying):
    """As `Flying`, for a script that takes turns with the processes of its fleet."""

    def pid(self, process: str) -> int:
        return os.getpid()


def fly_in_one_process(text: str, flight: Callable[[Any], None]) -> None:
    """Fly a fleet file; no process may end with an exception, and what always holds holds at the end."""

    def script(fleet: Fleet) -> None:
        recorder = FlightSampler(fleet.session, only=NEEDED)
        launcher = cast(Launcher, SimpleNamespace(supervisor=process.supervisor))
        flying = FlyingInOneProcess(Path(), fleet, {"main": launcher}, recorder)
        recorder.start()
        fleet.wait_ready(timeout_s=60)
        flight(flying)
        flying.check_promises()

    file = at_speed(parse_fleet(text), None, lockstep=True)
    with in_one_process(file, _unused) as process:
        process.run(script)
    assert not process.turns.failures


def _unused(message: RawMessage) -> None:
    """Scripts subscribe to what they need."""
