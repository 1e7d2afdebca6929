"""What the owner of each certificate of a fleet may do."""

from rcopterx.bus.access import Seat, Subject
from rcopterx.bus.channels import EXTERNAL_INPUT, KILL
from rcopterx.deploy.certificates.files import OUTSIDE, host_name, people
from rcopterx.fleet.schema import FleetFile


def subjects(fleet: FleetFile, here: str) -> list[Subject]:
    """Return all subjects that the router of the host `here` admits, with their permissions."""
    steering = operator_seats(fleet)
    found = [Subject(None, host_seats(fleet, here))]
    found += [Subject(host_name(host), host_seats(fleet, host)) for host in fleet.hosts]
    for kind, role in OUTSIDE.items():
        found += [Subject(f"{kind}.{vehicle}", (Seat(role, (vehicle,)),)) for vehicle in fleet.vehicles]
    found += [Subject(name, steering if name.startswith("operator.") else ()) for name in people(fleet)]
    return found


def operator_seats(fleet: FleetFile) -> tuple[Seat, ...]:
    """Return the permissions of operators: steer, kill, and fly vehicles by external programs."""
    vehicles = tuple(fleet.vehicles)
    return Seat(KILL.publisher, vehicles), Seat(EXTERNAL_INPUT.publisher, vehicles)


def host_seats(fleet: FleetFile, host: str) -> tuple[Seat, ...]:
    """Return the permissions of a host, by its roles in the fleet file."""
    seats = [Seat(role, host=host) for role in ("router", "recorder", "launcher")]
    seats.append(Seat("agent", fleet.agents_on(host), host))
    seats.append(Seat("transmitter_gateway", fleet.transmitters_on(host)))
    if fleet.tracker.host == host:
        seats.append(Seat("vicon_gateway", tuple(fleet.tracked)))
        seats += [Seat("agent", (name,), host) for name in fleet.subjects]
    if fleet.simulator is not None and fleet.simulator.host == host:
        seats.append(Seat("simulator"))
    if fleet.hosts[host].steering:
        seats += operator_seats(fleet)
    return tuple(seats)
