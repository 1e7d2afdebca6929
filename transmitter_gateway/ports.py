"""The port of a transmitter by its address."""

from rcopterx.transmitter_gateway.crazyradio import CrazyradioPort, crazyradio
from rcopterx.transmitter_gateway.port import Port
from rcopterx.transmitter_gateway.protocols.crtp import RADIO, RadioAddress
from rcopterx.transmitter_gateway.protocols.set_points import SetPointRadio
from rcopterx.transmitter_gateway.serial_port import SerialPort
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.udp_port import UDP, UdpPort


def port_for(settings: TransmitterSettings) -> Port:
    """Return a port for a transmitter, not yet opened."""
    if settings.port.startswith(UDP) and isinstance(settings.protocol, SetPointRadio):
        return UdpPort(settings.port, settings.protocol)
    if settings.port.startswith(RADIO):
        address = RadioAddress.of(settings.port)
        return CrazyradioPort(settings.port, address, crazyradio(address.dongle))
    return SerialPort(settings.port, settings.protocol.line)
