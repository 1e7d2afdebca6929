"""Promises of UDP ports with a port number of their own: a successor is found at the same one."""

import socket
from collections.abc import Iterator

import pytest
from support.udp import udp_paths

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
