"""Where the processes of a fleet find the radios."""

import os
from collections.abc import Hashable
from pathlib import Path

from rcopterx.deploy.hosts.run_directory import serial_path, states_directory
from rcopterx.fleet.consistency import check_unique
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.schema import FleetError, FleetFile, errors_at
from rcopterx.radios.crazyradio import RADIO
from rcopterx.radios.protocol import ProtocolError
from rcopterx.radios.udp import UDP, udp_address


def port_of(fleet: FleetFile, name: str, directory: Path) -> str:
    """Return the port of a vehicle's transmitter; `FleetError` if it is none for the protocol."""
    port = fleet.vehicles[name].transmitter.port
    protocol, where = protocol_of(fleet, name), f"vehicles.{name}.transmitter.port"
    with errors_at(where, ProtocolError):
        if protocol.is_address(port):
            return port
    if not protocol.serial and fleet.simulator is not None:
        raise FleetError(f"{where}: {port!r} is a device, simulated vehicles are at udp://")
    return str(serial_path(port, directory))


def check_ports(fleet: FleetFile, directory: Path) -> None:
    """Refuse a port that is none for its protocol, or leads where another does; raises `FleetError`."""
    ports = {name: port_of(fleet, name, directory) for name in fleet.vehicles}
    check_unique("transmitter.port", {f"vehicles.{name}": port for name, port in ports.items()}, _place_of)
    locals_ = {
        f"vehicles.{name}": f"{fleet.gateways[vehicle.transmitter.gateway].host}:{protocol.local_port}"
        for name, vehicle in fleet.vehicles.items()
        if ports[name].startswith(UDP) and (protocol := protocol_of(fleet, name)).local_port
    }
    check_unique("transmitter.settings.local_port", locals_)


def _place_of(port: str) -> Hashable:
    """Return what a port leads to: any Crazyradio reaches the same vehicle."""
    if port.startswith(RADIO):
        # Imported here: most radios are devices.
        from rcopterx.radios.crtp import RadioAddress

        address = RadioAddress.of(port)
        return address.channel, address.rate, address.address
    if port.startswith(UDP):
        host, number = udp_address(port.lower())
        return "127.0.0.1" if host == "localhost" else host, number
    # Several links may lead to one device.
    return os.path.realpath(port)


def laboratory_of(directory: Path) -> str:
    """Return the name of a simulated laboratory among all on this computer, by run directory."""
    return states_directory(directory).name
