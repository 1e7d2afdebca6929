"""Checks that names, hosts, leaders and devices in a fleet file are consistent."""

import math
import os.path
from collections.abc import Callable, Hashable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Final

from rcopterx.bus.channels import EVERY_FLEET, FIXED_UNITS
from rcopterx.bus.messages import Zone
from rcopterx.bus.processes import RESERVED_PROCESSES
from rcopterx.fleet.schema import FleetError, FleetFile, VolumeConfig, check_known
from rcopterx.user_text import ip_version, is_loopback

LARGEST_M: Final = 100.0  # of the coordinates of a flight volume and of zones, which are indoors


def check_consistency(fleet: FleetFile) -> None:
    """Refuse a file whose tables contradict each other; `FleetError` names the path of the wrong field."""
    _check_vehicles(fleet)
    _check_hosts(fleet)
    _check_security(fleet)
    _check_files(fleet)
    _check_leaders(fleet)


def _check_vehicles(fleet: FleetFile) -> None:
    if fleet.name == EVERY_FLEET:
        raise FleetError(f"name: {EVERY_FLEET!r} means every fleet, choose another one")
    if not fleet.vehicles:
        raise FleetError("vehicles: at least one vehicle is needed")
    reserved_names = {
        "vehicles": FIXED_UNITS,
        "subjects": (*FIXED_UNITS, *fleet.vehicles),
        "gateways": RESERVED_PROCESSES,
    }
    for group, reserved in reserved_names.items():
        for name in getattr(fleet, group):
            if name in reserved:
                raise FleetError(f"{group}.{name}: the name is reserved, as are {', '.join(reserved)}")
    subjects = {f"vehicles.{name}": vehicle.subject for name, vehicle in fleet.vehicles.items()}
    subjects |= {f"subjects.{name}": fleet.tracked[name] for name in fleet.subjects}
    check_unique("subject", subjects)
    ports = {f"vehicles.{name}": vehicle.transmitter.port for name, vehicle in fleet.vehicles.items()}
    check_unique("transmitter.port", ports, os.path.normpath)
    _check_corners("volume", fleet.volume)
    for name, zone in fleet.zones.items():
        check_zone(name, zone)


def check_zone(name: str, zone: Zone) -> None:
    """Check the corners of a keep-out zone; raises `FleetError`."""
    _check_corners(f"zones.{name}", zone)
    (x, y, _), (to_x, to_y, _) = zone.min_m, zone.max_m
    if zone.shape == "cylinder" and not math.isclose(to_x - x, to_y - y):
        raise FleetError(f"zones.{name}.max_m: a cylinder needs the corners of a square in x and y")


def _check_corners(where: str, bounds: VolumeConfig | Zone) -> None:
    for axis, (a, b) in enumerate(zip(bounds.min_m, bounds.max_m, strict=True)):
        for field, at_m in ((f"min_m[{axis}]", a), (f"max_m[{axis}]", b)):
            if abs(at_m) > LARGEST_M:
                raise FleetError(f"{where}.{field}: {at_m:g} m is more than {LARGEST_M:g} m: in millimetres?")
        if not a < b:
            raise FleetError(f"{where}.max_m[{axis}]: {b} must be greater than min_m[{axis}] = {a}")


def check_unique(field: str, values: Mapping[str, str], key: Callable[[str], Hashable] = str) -> None:
    """Refuse two values of a field, by table, whose keys are equal; `FleetError` names the second one."""
    seen: dict[Hashable, str] = {}
    for table, value in values.items():
        if (other := seen.setdefault(key(value), table)) != table:
            written = "" if values[other] == value else f", there {values[other]!r}"
            raise FleetError(f"{table}.{field}: {value!r} is already that of {other}{written}")


def _check_hosts(fleet: FleetFile) -> None:
    addresses = {name: f"{host.address}:{fleet.router_port(name)}" for name, host in fleet.hosts.items()}
    check_unique("router_port", {f"hosts.{name}": address for name, address in addresses.items()})
    for name, address in addresses.items():
        host_address = fleet.hosts[name].address
        if ":" in host_address and ip_version(host_address) != 6:
            raise FleetError(f"hosts.{name}.address: {host_address!r}: the port belongs into router_port")
        if not address.isascii():
            raise FleetError(f"hosts.{name}.address: {fleet.hosts[name].address!r} must be in ASCII")
        if fleet.simulator is not None and address == fleet.tracker.address:
            raise FleetError(f"tracker.address: {address} is already that of the router of hosts.{name}")
    uses = {"tracker.host": fleet.tracker.host, "log.host": fleet.log.host}
    uses["simulator.host"] = None if fleet.simulator is None else fleet.simulator.host
    uses |= {f"gateways.{name}.host": gateway.host for name, gateway in fleet.gateways.items()}
    for where, used in uses.items():
        if used is not None:
            check_known(where, "host", used, fleet.hosts)
    for name, vehicle in fleet.vehicles.items():
        check_known(f"vehicles.{name}.host", "host", vehicle.host, fleet.hosts)
        for number, spare in enumerate(vehicle.spares):
            where = f"vehicles.{name}.spares[{number}]"
            check_known(where, "host", spare, fleet.hosts)
            if spare in fleet.agent_hosts(name)[: number + 1]:
                raise FleetError(f"{where}: {spare!r} runs its agent already")
        gateway = vehicle.transmitter.gateway
        check_known(f"vehicles.{name}.transmitter.gateway", "gateway", gateway, fleet.gateways)
        if fleet.simulator is not None and fleet.gateways[gateway].host != fleet.simulator.host:
            raise FleetError(
                f"gateways.{gateway}.host: simulated radios are on the simulator's host "
                f"{fleet.simulator.host!r}, not on {fleet.gateways[gateway].host!r}"
            )
    for name in () if fleet.simulator is None else fleet.simulator.start:
        check_known(f"simulator.start.{name}", "vehicle", name, fleet.vehicles)


def _check_security(fleet: FleetFile) -> None:
    security = fleet.security
    for group in ("operators", "watchers"):
        _check_once(f"security.{group}[{{}}]", getattr(security, group))
    if security.certificates is not None:
        if security.insecure:
            raise FleetError("security.insecure: true, but there are certificates; leave out one of them")
        if not security.certificates.startswith(("/", "~/")):
            raise FleetError(
                f"security.certificates: {security.certificates!r} must be an absolute path or begin with "
                "~/, because every host reads it"
            )
        return
    for name, host in fleet.hosts.items():
        if not (security.insecure or is_loopback(host.address)):
            raise FleetError(
                f"hosts.{name}.address: {host.address} can be reached by others, and without certificates "
                "any program there can steer the fleet; name a directory in security.certificates and make "
                "them by rcopterx certs, or write insecure = true under [security]"
            )


def _check_files(fleet: FleetFile) -> None:
    """Refuse paths below `~` that may not exist: of a named user, or of one without a home directory."""
    files = {
        "log.directory": fleet.log.directory,
        "tracker.record_raw": fleet.tracker.record_raw,
        "security.certificates": fleet.security.certificates,
    }
    files |= {f"vehicles.{name}.type": vehicle.type for name, vehicle in fleet.vehicles.items()}
    for where, path in files.items():
        if path is None or not path.startswith("~"):
            continue
        if not path.startswith("~/"):
            raise FleetError(f"{where}: {path!r}: a path that begins with ~ must begin with ~/")
        if os.path.expanduser(path) == path:
            raise FleetError(f"{where}: {path!r}: this user has no home directory, give an absolute path")


def _check_leaders(fleet: FleetFile) -> None:
    for name, vehicle in fleet.vehicles.items():
        for number, link in enumerate(vehicle.follow):
            where = f"vehicles.{name}.follow[{number}].leader"
            check_known(where, "vehicle", link.leader, fleet.tracked)
            if link.leader == name:
                raise FleetError(f"{where}: {name} cannot follow itself, that is a cycle")
        _check_once(f"vehicles.{name}.follow[{{}}].leader", [link.leader for link in vehicle.follow])
        for number, successor in enumerate(vehicle.successors):
            where = f"vehicles.{name}.successors[{number}]"
            if successor not in fleet.vehicles or successor == name:
                others = ", ".join(other for other in fleet.vehicles if other != name)
                raise FleetError(f"{where}: {successor!r} cannot succeed {name}, allowed are {others}")
            if fleet.vehicles[successor].leader_lost.then != "promote":
                raise FleetError(
                    f'{where}: {successor} does not want to lead; give it leader_lost.then = "promote"'
                )
        _check_once(f"vehicles.{name}.successors[{{}}]", vehicle.successors)
    leaders = {name: [link.leader for link in vehicle.follow] for name, vehicle in fleet.vehicles.items()}
    try:
        TopologicalSorter(leaders).prepare()
    except CycleError as error:
        cycle = error.args[1][::-1]
        raise FleetError(f"vehicles.{cycle[0]}.follow: a cycle of leaders: {' -> '.join(cycle)}") from None


def _check_once(where: str, names: Sequence[str]) -> None:
    """Refuse a list with a name that it has already; `where` has a place for its number."""
    for number, name in enumerate(names):
        if name in names[:number]:
            raise FleetError(f"{where.format(number)}: {name!r} is named twice")


def check_periods(fleet: FleetFile) -> None:
    """Check that a control period is a whole number of frames, because poses pace the agents."""
    where, camera = ("tracker", fleet.tracker) if fleet.simulator is None else ("simulator", fleet.simulator)
    rate_hz = camera.rate_hz
    if rate_hz is None:  # a Vicon Tracker reports it once it is connected
        return
    for name, vehicle in fleet.vehicles.items():
        period_s = vehicle.control.period_s
        frames = period_s * rate_hz
        if round(frames) < 1 or abs(frames - round(frames)) > 0.01:
            raise FleetError(
                f"vehicles.{name}.control.period_s: {period_s:g} s is no whole number of frames of "
                f"{where}.rate_hz = {rate_hz:g} Hz; {max(round(frames), 1) / rate_hz:.6g} s or "
                f"{max(round(frames), 1) / period_s:g} Hz would fit"
            )
