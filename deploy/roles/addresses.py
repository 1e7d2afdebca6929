"""Where the processes of a fleet find the bus."""

from rcopterx.bus.session import BusAddress
from rcopterx.deploy.certificates.files import own_credentials
from rcopterx.deploy.hosts.run_directory import router_socket, run_directory
from rcopterx.fleet.schema import FleetFile


def bus_address(fleet: FleetFile, host: str) -> BusAddress:
    """Where processes of a host find their router: its socket, or its address if that is not there."""
    return BusAddress(
        endpoints=tuple(router_endpoints(fleet, host)),
        fleet=fleet.name,
        namespace=fleet.bus.namespace,
        host=host,
        credentials=own_credentials(fleet, host),
    )


def router_endpoints(fleet: FleetFile, host: str) -> list[str]:
    """Endpoints the router of a host listens on, the fastest first."""
    local = router_socket(host, run_directory(fleet.name, fleet.bus.namespace))
    return [fleet.endpoint(host)] if local is None else [local, fleet.endpoint(host)]
