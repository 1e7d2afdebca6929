"""Where the processes of a fleet, and programs that join it, find the bus."""

from dataclasses import astuple, replace

from rcopterx.bus.channels import FIXED_UNITS
from rcopterx.bus.clock import Clock
from rcopterx.bus.session import BusAddress
from rcopterx.deploy.certificates.files import own_credentials
from rcopterx.deploy.hosts.run_directory import lockstep_path, router_socket, run_directory
from rcopterx.deploy.hosts.running import RunningFleet
from rcopterx.fleet.schema import FleetFile


def bus_address(fleet: FleetFile, host: str, process: str = "") -> BusAddress:
    """Return where processes of a host find their router; in lockstep only a named `process` takes turns."""
    return BusAddress(
        endpoints=tuple(router_endpoints(fleet, host)),
        fleet=fleet.name,
        namespace=fleet.bus.namespace,
        host=host,
        credentials=own_credentials(fleet, host),
        units=frozenset({*fleet.tracked, *fleet.hosts, *FIXED_UNITS}),
        clock=clock_of(fleet),
        process=process,
    )


def clock_of(fleet: FleetFile) -> Clock:
    """Return the clock of a fleet; in lockstep with its page."""
    if not fleet.clock.lockstep:
        return fleet.clock
    return replace(fleet.clock, page=lockstep_path(run_directory(fleet.name, fleet.bus.namespace)))


def router_endpoints(fleet: FleetFile, host: str) -> list[str]:
    """Return the endpoints of the router of a host, the fastest first."""
    local = router_socket(host, run_directory(fleet.name, fleet.bus.namespace))
    others = [fleet.endpoint(host)] if fleet.listens(host) or local is None else []
    return others if local is None else [local, *others]


def record_of(fleet: FleetFile, host: str, digest: str = "", snapshot: str = "") -> RunningFleet:
    """Return the record of a fleet that is up, as seen from a host, with what programs need to join it."""
    own = own_credentials(fleet, host)
    return RunningFleet(
        fleet=fleet.name,
        digest=digest,
        namespace=fleet.bus.namespace,
        host=host,
        endpoints=router_endpoints(fleet, host),
        others=[fleet.endpoint(other) for other in fleet.hosts if other != host],
        vehicles=list(fleet.vehicles),
        snapshot=snapshot,
        credentials=None if own is None else list(astuple(own)),
    )
