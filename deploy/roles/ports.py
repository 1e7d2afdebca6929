"""Where the processes of a fleet find the radios."""

from pathlib import Path

from rcopterx.deploy.hosts.run_directory import serial_path
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.transmitter_gateway.protocols.base import ProtocolError
from rcopterx.transmitter_gateway.protocols.crazyflie import CrazyflieProtocol
from rcopterx.transmitter_gateway.protocols.crtp import RADIO, RadioAddress, udp_address


def port_of(fleet: FleetFile, name: str, directory: Path) -> str:
    """Return the port of a vehicle's transmitter; a serial device may be in the run directory.

    Raises `FleetError`: it is none for the vehicle's protocol.
    """
    port = fleet.vehicles[name].transmitter.port
    if not isinstance(protocol_of(fleet, name), CrazyflieProtocol):
        return str(serial_path(port, directory))
    try:
        if port.startswith(RADIO):
            RadioAddress.of(port)
        else:
            udp_address(port)
    except ProtocolError as error:
        raise FleetError(f"vehicles.{name}.transmitter.port: {error}") from None
    if fleet.simulator is not None and port.startswith(RADIO):
        raise FleetError(
            f"vehicles.{name}.transmitter.port: {port!r} is a radio, simulated vehicles are at udp://"
        )
    return port
