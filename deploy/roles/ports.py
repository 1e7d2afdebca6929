"""Where the processes of a fleet find the radios."""

from pathlib import Path

from rcopterx.deploy.hosts.run_directory import serial_path
from rcopterx.fleet.radios import protocol_of
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.transmitter_gateway.protocols.base import ProtocolError
from rcopterx.transmitter_gateway.protocols.crazyflie import CrazyflieProtocol
from rcopterx.transmitter_gateway.protocols.crtp import RadioAddress
from rcopterx.transmitter_gateway.protocols.set_points import SetPointRadio
from rcopterx.transmitter_gateway.udp_port import UDP, udp_address


def port_of(fleet: FleetFile, name: str, directory: Path) -> str:
    """Return the port of a vehicle's transmitter; `FleetError` if it is none for the protocol."""
    port = fleet.vehicles[name].transmitter.port
    protocol, where = protocol_of(fleet, name), f"vehicles.{name}.transmitter.port"
    addressed = isinstance(protocol, SetPointRadio)
    try:
        if addressed and port.startswith(UDP):
            udp_address(port)
            return port
        if isinstance(protocol, CrazyflieProtocol):
            RadioAddress.of(port)
    except ProtocolError as error:
        raise FleetError(f"{where}: {error}") from None
    if addressed and fleet.simulator is not None:
        raise FleetError(f"{where}: {port!r} is a radio, simulated vehicles are at udp://")
    return port if isinstance(protocol, CrazyflieProtocol) else str(serial_path(port, directory))
