"""Checks that this host can run its part of a fleet, before any process is started."""

import errno
import os
import socket
from collections.abc import Collection
from datetime import UTC, datetime
from pathlib import Path

from rcopterx.deploy.certificates.files import directory_of, host_name
from rcopterx.deploy.hosts.run_directory import serial_path
from rcopterx.deploy.hosts.running import running_fleets
from rcopterx.deploy.roles.tracker import check_motion_capture, tracker_address
from rcopterx.fleet.schema import FleetError, FleetFile, check_known
from rcopterx.transmitter_gateway.adapters import BY_PLACE, with_same_serial_number


def check_resources(fleet: FleetFile, host: str, directory: Path, without: Collection[str] = ()) -> list[str]:
    """Check that addresses are free and that serial devices exist, except those of vehicles in `without`.

    A fleet also flies when the device of one of its vehicles is missing; that vehicle joins once it is there.
    Returns a line for every such vehicle. Raises `FleetError`: names the field and the address or device.
    """
    check_router(fleet, host)
    if host == fleet.tracker.host:
        check_motion_capture(fleet)
    if fleet.simulator is not None:
        if fleet.simulator.host == host:
            check_free(*tracker_address(fleet), "tracker.address")
        return []
    missing = []
    needed = [name for name in fleet.transmitters_on(host) if name not in without]
    for name in needed:
        port = fleet.vehicles[name].transmitter.port
        if "://" in port:
            continue
        device = serial_path(port, directory)
        where = f"vehicles.{name}.transmitter.port"
        if alike := with_same_serial_number(str(device)):
            raise FleetError(
                f"{where}: {device} may lead to any of {', '.join(alike)}, which have the same serial "
                f"number; name them by their places in {BY_PLACE}"
            )
        if not device.exists():
            missing.append(f"{where}: there is no device {device}")
        elif not os.access(device, os.R_OK | os.W_OK):
            raise FleetError(
                f"{where}: no permission for {device}; install the rules of rcopterx udev-rules, or join the "
                "group of the device (sudo usermod -aG dialout $USER) and log in again"
            )
    if missing and len(missing) == len(needed):
        raise FleetError("; ".join(missing))
    return [f"{line}; the others fly without it" for line in missing]


def check_without(fleet: FleetFile, without: Collection[str]) -> None:
    """Check the vehicles that shall not take part; `FleetError` if one is unknown or none is left."""
    for name in without:
        check_known("--without", "vehicle", name, fleet.vehicles)
    if len(set(without)) == len(fleet.vehicles):
        raise FleetError("--without: at least one vehicle must take part")


def check_router(fleet: FleetFile, host: str) -> None:
    """Check that the router can listen and the fleet is not up on this computer; raises `FleetError`."""
    for running in running_fleets():
        if (running.fleet, running.namespace, running.host) == (fleet.name, fleet.bus.namespace, host):
            raise FleetError(f"{fleet.name} is already up on this computer; stop it first")
    if fleet.listens(host):
        check_free(fleet.hosts[host].address, fleet.router_port(host), f"hosts.{host}.router_port")


def check_free(address: str, port: int, where: str) -> None:
    """Check that no other program listens at an address; `FleetError` begins with the field `where`."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except UnicodeError:
            raise FleetError(f"{where}: {address!r} is no name of a host") from None
        except OSError as error:
            busy = "; is the fleet already up? Stop it, or give another port"
            hint = busy if error.errno == errno.EADDRINUSE else ""
            raise FleetError(f"{where}: {address}:{port} cannot be used: {error.strerror}{hint}") from None


def check_certificate(fleet: FleetFile, host: str) -> None:
    """Check the certificate of this host, in a fleet with certificates; `FleetError` says what is wrong."""
    if (directory := directory_of(fleet)) is None:
        return
    # The library imports slowly, and fleets on one computer do without.
    from rcopterx.deploy.certificates.issuing import problem

    if (wrong := problem(directory, host_name(host), datetime.now(UTC))) is not None:
        raise FleetError(f"security.certificates: {wrong}; rcopterx certs makes certificates")
