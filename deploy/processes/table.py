"""The list of processes of a fleet, as data."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rcopterx.fleet.schema import FleetError, FleetFile

ROUTER: Final = "router"
"""Name and role of the process that routes messages."""
EXIT_ELSEWHERE: Final = 4
"""Exit code of an agent whose vehicle another agent flies; it is not started again."""
TAKE_OVER: Final = "--take-over"
"""Word of the command line of an agent that takes over from another one."""
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
    host
        Where it runs; empty for where the fleet file has it.
    """

    name: str
    role: str
    unit: str
    stop_order: int
    host: str = ""

    def command(self, snapshot: Path, *, take_over: bool = False) -> list[str]:
        """Command line that starts the process by the snapshot of a fleet file.

        Parameters
        ----------
        snapshot
            The snapshot.
        take_over
            Whether an agent shall take over from one that flies its vehicle.
        """
        words = [self.role, self.unit, str(snapshot), self.host, TAKE_OVER if take_over else ""]
        return [sys.executable, "-m", "rcopterx.deploy.roles", *filter(None, words)]


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
    specs += [ProcessSpec(agent_process(name), "agent", name, 0, host) for name in fleet.agents_on(host)]
    return specs


def agent_process(vehicle: str) -> str:
    """Name of the process of a vehicle's agent."""
    return f"agent-{vehicle}"
