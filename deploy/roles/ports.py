"""Where the processes of a fleet find the radios."""

from pathlib import Path

from rcopterx.deploy.hosts.run_directory import serial_path
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.transmitter_gateway.protocols.base import ProtocolError
from rcopterx.transmitter_gateway.protocols.crazyflie import CrazyflieProtocol
from rcopterx.transmitter_gateway.protocols.crtp import udp_address


def port_of(fleet: FleetFile, name: str, directory: Path) -> str:
    """Return the port of a vehicle's transmitter; a serial device may be in the run directory.

    Raises `FleetError`: it is none for the vehicle's protocol.
    """
    port = fleet.vehicles[name].transmitter.port
    if not isinstance(protocol_of(fleet, name), CrazyflieProtocol):
        return str(serial_path(port, directory))
    try:
        udp_address(port)
    except ProtocolError as error:
        raise FleetError(f"vehicles.{name}.transmitter.port: {error}") from None
    return port
