"""The role of the bus router of a host, without numerical libraries."""

from importlib.metadata import version

from rcopterx.bus.endpoints import Protection
from rcopterx.bus.requests import IdentifyReply
from rcopterx.bus.router import run_router
from rcopterx.deploy.certificates.files import credentials, directory_of, host_name
from rcopterx.deploy.hosts.run_directory import run_directory, snapshot_path
from rcopterx.deploy.hosts.running import recorded
from rcopterx.deploy.roles.addresses import record_of
from rcopterx.deploy.roles.priorities import Priority
from rcopterx.fleet.reading import digest_of, write_snapshot
from rcopterx.fleet.schema import FleetFile


def run(fleet: FleetFile, host: str) -> None:
    """Route messages for a host, and answer requests that identify the fleet."""
    hosts = list(fleet.hosts)
    others = [other for other in hosts if other != host]
    directory = run_directory(fleet.name, fleet.bus.namespace)
    snapshot = snapshot_path(host, directory)
    digest = digest_of(fleet)
    write_snapshot(fleet, snapshot)
    running = record_of(fleet, host, digest, str(snapshot))
    identity = IdentifyReply(
        accepted=True,
        fleet=fleet.name,
        host=host,
        digest=digest,
        vehicles=tuple(fleet.vehicles),
        version=version("rcopterx"),
    )
    # Each router connects to those of earlier hosts in the file: one link between two is enough.
    earlier = [fleet.endpoint(other) for other in hosts[: hosts.index(host)]]
    with recorded(directory, running):
        run_router(
            running.endpoints,
            earlier,
            fleet.bus.namespace,
            Priority.ROUTER.of(fleet),
            identity,
            others,
            protection_of(fleet, host),
            fleet.clock,
        )


def protection_of(fleet: FleetFile, host: str) -> Protection | None:
    """Return certificates and access rules of the router of a host; None without certificates."""
    if (directory := directory_of(fleet)) is None:
        return None
    # Imported here: fleets on one computer do without.
    from rcopterx.bus.access import access_control
    from rcopterx.deploy.certificates.seats import subjects

    rules = access_control(fleet.name, fleet.bus.namespace, subjects(fleet, host))
    return Protection(credentials(directory, host_name(host)), rules)
