"""The list of processes of a fleet, as data."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rcopterx.deploy.fleet_file.schema import FleetError, FleetFile

ROUTER: Final = "router"
"""Name and role of the process that routes messages."""
EXIT_ELSEWHERE: Final = 4
"""Exit code of an agent whose vehicle another agent flies; it is not started again."""
RECORDER: Final = "recorder"
"""Name and role of the process that writes the flight log."""


@dataclass(frozen=True)
class ProcessSpec:
    """One process to keep running.

    Attributes
    ----------
    name
        Unique on its host; also the name of its log file.
    role
        `router`, `recorder`, `simulator`, `tracker`, `transmitters` or `agent`.
    unit
        What the role is for: a host, a gateway or a vehicle.
    stop_order
        Processes with lower numbers are stopped first.
    """

    name: str
    role: str
    unit: str
    stop_order: int

    def command(self, snapshot: Path) -> list[str]:
        """Command line that starts the process by the snapshot of a fleet file."""
        return [sys.executable, "-m", "rcopterx.deploy.roles", self.role, self.unit, str(snapshot)]


def recording_host(fleet: FleetFile) -> str:
    """Host whose recorder writes the flight log."""
    return fleet.log.host or next(iter(fleet.hosts))


def processes_of(fleet: FleetFile, host: str) -> list[ProcessSpec]:
    """Processes of one host in the order they are started.

    Raises
    ------
    FleetError
        Unknown host.
    """
    if host not in fleet.hosts:
        raise FleetError(f"hosts: unknown host {host!r}, known are {', '.join(fleet.hosts)}")
    specs = [ProcessSpec(ROUTER, ROUTER, host, 5)]
    if host == recording_host(fleet):
        # Started before those whose first words it shall hear, stopped after them.
        specs.append(ProcessSpec(RECORDER, RECORDER, host, 4))
    if fleet.simulator is not None and fleet.simulator.host == host:
        specs.append(ProcessSpec("simulator", "simulator", host, 3))
    if fleet.tracker.host == host:
        specs.append(ProcessSpec("tracker", "tracker", host, 2))
    specs += [
        ProcessSpec(name, "transmitters", name, 1)
        for name, gateway in fleet.gateways.items()
        if gateway.host == host
        and any(vehicle.transmitter.gateway == name for vehicle in fleet.vehicles.values())
    ]
    specs += [
        ProcessSpec(f"agent-{name}", "agent", name, 0)
        for name, vehicle in fleet.vehicles.items()
        if vehicle.host == host
    ]
    return specs
