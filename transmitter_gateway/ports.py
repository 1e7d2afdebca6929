"""The port of a transmitter by its address."""

from rcopterx.transmitter_gateway.port import Port
from rcopterx.transmitter_gateway.protocols.crtp import UDP
from rcopterx.transmitter_gateway.serial_port import SerialPort
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.udp_port import UdpPort


def port_for(settings: TransmitterSettings) -> Port:
    """Return a port for a transmitter, not yet opened."""
    if settings.port.startswith(UDP):
        return UdpPort(settings.port)
    return SerialPort(settings.port, settings.protocol.line)
