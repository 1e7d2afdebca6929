"""The role of the bus router of a host; it needs no numerical library."""

from bus.router import run_router
from deploy.fleet_file.schema import FleetFile
from deploy.roles.addresses import router_endpoints
from deploy.roles.priorities import Priority


def run(fleet: FleetFile, host: str) -> None:
    """Route messages for a host; links to the routers of the hosts before it in the file."""
    hosts = list(fleet.hosts)
    others = [fleet.endpoint(other) for other in hosts[: hosts.index(host)]]
    run_router(router_endpoints(fleet, host), others, fleet.bus.namespace, Priority.ROUTER.of(fleet))
