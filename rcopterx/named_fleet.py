"""Routers of the fleet of a file, for `rcopterx kill -f`."""

from rcopterx.deploy.certificates.files import shown
from rcopterx.deploy.hosts.running import RunningFleet
from rcopterx.deploy.roles.addresses import router_endpoints
from rcopterx.fleet.reading import load_fleet
from rcopterx.fleet.schema import FleetError
from rcopterx.fleet.shipped import fleet_path

__all__ = ["FleetError", "fleet_of"]


def fleet_of(name: str) -> RunningFleet:
    """Routers and vehicles of a fleet file or a shipped fleet; raises FleetError."""
    file = load_fleet(fleet_path(name))
    host, *others = file.hosts
    return RunningFleet(
        fleet=file.name,
        digest="",
        namespace=file.bus.namespace,
        host=host,
        endpoints=router_endpoints(file, host),
        others=[file.endpoint(other) for other in others],
        vehicles=list(file.vehicles),
        snapshot="",
        credentials=shown(file, host),
    )
