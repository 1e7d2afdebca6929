"""Promises of UDP ports: a successor is found at the port number of its own, long datagrams are rejected."""

import socket
from collections.abc import Iterator

import pytest
from support.udp import udp_paths
from support.waiting import wait_for

from rcopterx.transmitter_gateway.protocols import crtp
from rcopterx.transmitter_gateway.protocols.crazyflie import CrazyflieProtocol
from rcopterx.transmitter_gateway.protocols.mavlink import MavlinkProtocol
from rcopterx.transmitter_gateway.protocols.mavlink_settings import MavlinkSettings
from rcopterx.transmitter_gateway.udp_port import PROBE_S, UdpPort, udp_address


@pytest.fixture
def vehicle() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        vehicle.settimeout(10.0)
        yield vehicle


def port_to(vehicle: socket.socket, local_port: int) -> UdpPort:
    path = f"udp://127.0.0.1:{vehicle.getsockname()[1]}"
    return UdpPort(path, MavlinkProtocol(MavlinkSettings(local_port=local_port)))


def test_a_port_and_its_successor_send_from_the_number_of_the_settings(vehicle: socket.socket) -> None:
    local_port = udp_address(udp_paths(1)[0])[1]
    port, successor = (port_to(vehicle, local_port) for _ in range(2))
    assert not port.service(0.0)
    _, sender = vehicle.recvfrom(2048)
    assert sender == ("127.0.0.1", local_port)
    vehicle.sendto(b"\xfd", sender)
    assert port.service(2 * PROBE_S)
    assert not successor.service(0.0)
    assert successor.problem is not None
    assert "in use" in successor.problem
    port.close()
    assert not successor.service(2 * PROBE_S)
    assert vehicle.recvfrom(2048)[1] == sender
    successor.close()


def test_a_datagram_that_is_too_long_is_counted_and_those_beside_it_are_read(vehicle: socket.socket) -> None:
    protocol = CrazyflieProtocol()
    port = UdpPort(f"udp://127.0.0.1:{vehicle.getsockname()[1]}", protocol)
    port.service(0.0)
    _, sender = vehicle.recvfrom(2048)
    vehicle.sendto(crtp.NULL_PACKET, sender)
    wait_for(lambda: port.service(2 * PROBE_S), "the port does not open")
    protocol.link_opened(0.0)
    state = crtp.SupervisorState(can_be_armed=True).packet().to_bytes()
    for packet in (bytes(300), bytes(crtp.LONGEST_DATA + 2), state):
        vehicle.sendto(packet, sender)

    def ready() -> bool:
        protocol.receive(port.read_available(0.0), 0.0)
        return protocol.status(0.0).ready

    wait_for(ready, "the state does not arrive")
    assert protocol.counters == {"crtp: packet that is empty or longer than 31 bytes": 2}
    port.close()
