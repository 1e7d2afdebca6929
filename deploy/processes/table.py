"""The processes of a fleet on its hosts."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rcopterx.bus.processes import AGENT, LEARNER, RECORDER, ROUTER, SIMULATOR, TRACKER, TRANSMITTERS
from rcopterx.fleet.schema import FleetFile, check_known

EXIT_ELSEWHERE: Final = 4  # of an agent whose vehicle another one flies, and which is not restarted
TAKE_OVER: Final = "--take-over"  # option of an agent that takes over from another one


@dataclass(frozen=True)
class ProcessSpec:
    """One process to keep running."""

    name: str  # unique on its host; also the name of its log file
    role: str  # one of `ROLES`
    unit: str  # host, gateway or vehicle that the process serves
    host: str = ""  # host of an agent; empty for that of the fleet file
    landing_s: float = 0.0  # how much longer it may take to end, because it lands vehicles, in real time

    def command(self, snapshot: Path, *, take_over: bool = False) -> list[str]:
        """Return the command line of the process; with `take_over` an agent takes over from another one."""
        words = [self.role, self.unit, str(snapshot), self.host, TAKE_OVER if take_over else ""]
        return [sys.executable, "-m", "rcopterx.deploy.roles", *filter(None, words)]


def processes_of(fleet: FleetFile, host: str) -> list[ProcessSpec]:
    """Return the processes of a host in starting order; `FleetError` for an unknown host."""
    check_known("hosts", "host", host, fleet.hosts)
    # Routers import this module and start without the limits of vehicles.
    from rcopterx.fleet.vehicle_models import learning_models, longest_shutdown_s

    specs = [ProcessSpec(ROUTER, ROUTER, host)]
    if host == (fleet.log.host or next(iter(fleet.hosts))):
        specs.append(ProcessSpec(RECORDER, RECORDER, host))
        # It sends requests of an operator.
        if fleet.hosts[host].steering and learning_models(fleet):
            specs.append(ProcessSpec(LEARNER, LEARNER, host))
    if fleet.simulator is not None and fleet.simulator.host == host:
        specs.append(ProcessSpec(SIMULATOR, SIMULATOR, host))
    if fleet.tracker.host == host:
        specs.append(ProcessSpec(TRACKER, TRACKER, host))
    specs += [
        ProcessSpec(name, TRANSMITTERS, name, landing_s=fleet.clock.real_s(longest_shutdown_s(fleet, host)))
        for name, gateway in fleet.gateways.items()
        if gateway.host == host and fleet.served_by(name)
    ]
    specs += [ProcessSpec(agent_process(name), AGENT, name, host) for name in fleet.agents_on(host)]
    return specs


def agent_process(vehicle: str) -> str:
    """Return the name of the process of a vehicle's agent."""
    return f"agent-{vehicle}"
