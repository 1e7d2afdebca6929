"""Where the processes of a fleet find the bus."""

from rcopterx.bus.channels import FIXED_UNITS
from rcopterx.bus.session import BusAddress
from rcopterx.deploy.certificates.files import own_credentials
from rcopterx.deploy.hosts.run_directory import router_socket, run_directory
from rcopterx.fleet.schema import FleetFile


def bus_address(fleet: FleetFile, host: str) -> BusAddress:
    """Return where processes of a host find their router: at its socket, or at its TCP address."""
    return BusAddress(
        endpoints=tuple(router_endpoints(fleet, host)),
        fleet=fleet.name,
        namespace=fleet.bus.namespace,
        host=host,
        credentials=own_credentials(fleet, host),
        units=frozenset({*fleet.vehicles, *fleet.hosts, *FIXED_UNITS}),
        clock=fleet.clock,
    )


def router_endpoints(fleet: FleetFile, host: str) -> list[str]:
    """Return the endpoints of the router of a host, the fastest first."""
    local = router_socket(host, run_directory(fleet.name, fleet.bus.namespace))
    others = [fleet.endpoint(host)] if fleet.listens(host) or local is None else []
    return others if local is None else [local, *others]
