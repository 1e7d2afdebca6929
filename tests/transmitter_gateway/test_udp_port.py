"""Promises of UDP ports: names are looked up beside the loop, a successor is found at the port number of its
own, long datagrams are rejected.
"""

import socket
import time
from collections.abc import Callable, Iterator

import pytest
from support.garbage import no_garbage
from support.udp import udp_paths
from support.waiting import wait_for

from rcopterx.radios import crtp
from rcopterx.radios.crazyflie import CrazyflieProtocol
from rcopterx.radios.mavlink import MavlinkProtocol
from rcopterx.radios.mavlink_settings import MavlinkSettings
from rcopterx.radios.udp import udp_address
from rcopterx.transmitter_gateway.udp_port import LOOK_UP_S, PROBE_S, UdpPort


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


class NameService:
    """Holds look-ups back until `answer` gives an address, or an error."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._waiting: list[Callable[[], None]] = []
        self.found: str | OSError = socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        monkeypatch.setattr(socket, "getaddrinfo", self._look_up)

    def _look_up(self, *_: object) -> list[object]:
        if isinstance(self.found, OSError):
            raise self.found
        return [(socket.AF_INET, socket.SOCK_DGRAM, 17, "", (self.found, 0))]

    def start(self, work: Callable[[], None]) -> None:
        """Instead of a thread."""
        self._waiting.append(work)

    @property
    def waiting(self) -> int:
        """Number of look-ups that wait."""
        return len(self._waiting)

    def answer(self, found: str | OSError) -> None:
        """Complete the look-ups that wait."""
        self.found = found
        while self._waiting:
            self._waiting.pop()()


@pytest.fixture
def names(monkeypatch: pytest.MonkeyPatch) -> NameService:
    return NameService(monkeypatch)


def port_by_name(vehicle: socket.socket, names: NameService) -> UdpPort:
    return UdpPort(f"udp://drone.lab:{vehicle.getsockname()[1]}", MavlinkProtocol(), names.start)


def test_a_name_service_that_does_not_answer_delays_no_turn_of_the_loop(
    vehicle: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_: time.sleep(3.0))
    port = UdpPort(f"udp://drone.lab:{vehicle.getsockname()[1]}", MavlinkProtocol())
    began_s = time.monotonic()
    for turn in range(20):
        assert not port.service(turn * PROBE_S)
    assert time.monotonic() - began_s < 1.0
    assert port.problem is not None
    assert "the name service has not found drone.lab yet" in port.problem


def test_a_vehicle_is_reached_once_its_name_is_found(vehicle: socket.socket, names: NameService) -> None:
    port = port_by_name(vehicle, names)
    assert not port.service(0.0)
    names.answer("127.0.0.1")
    assert not port.service(2 * PROBE_S)
    _, sender = vehicle.recvfrom(2048)
    vehicle.sendto(b"\xfd", sender)
    wait_for(lambda: port.service(4 * PROBE_S), "the port does not open")
    port.close()


def test_an_unknown_name_is_a_problem_and_is_looked_up_again(
    vehicle: socket.socket, names: NameService
) -> None:
    port = port_by_name(vehicle, names)
    assert not port.service(0.0)
    names.answer(names.found)
    assert not port.service(2 * PROBE_S)
    assert port.problem is not None
    assert "Name or service not known" in port.problem
    assert not port.service(LOOK_UP_S)
    assert names.waiting == 1
    names.answer("127.0.0.1")
    assert not port.service(LOOK_UP_S + 2 * PROBE_S)
    assert vehicle.recvfrom(2048)[0]
    port.close()


def test_a_vehicle_that_returns_under_another_address_is_found(
    vehicle: socket.socket, names: NameService
) -> None:
    port = port_by_name(vehicle, names)
    assert not port.service(0.0)
    names.answer("127.0.0.2")
    assert not port.service(2 * PROBE_S)
    assert not port.service(LOOK_UP_S)
    names.answer("127.0.0.1")
    assert not port.service(LOOK_UP_S + 2 * PROBE_S)
    assert vehicle.recvfrom(2048)[0]
    port.close()


def test_a_name_service_that_fails_later_does_not_lose_the_address(
    vehicle: socket.socket, names: NameService
) -> None:
    port = port_by_name(vehicle, names)
    assert not port.service(0.0)
    names.answer("127.0.0.1")
    assert not port.service(2 * PROBE_S)
    assert not port.service(LOOK_UP_S)
    names.answer(OSError("no network"))
    assert not port.service(LOOK_UP_S + 2 * PROBE_S)
    assert port.problem is not None
    assert "no answer from" in port.problem
    port.close()


def test_a_name_that_is_never_found_leaves_no_reference_cycles(
    vehicle: socket.socket, names: NameService
) -> None:
    port = port_by_name(vehicle, names)
    with no_garbage():
        for turn in range(100):
            assert not port.service(turn * LOOK_UP_S)
            names.answer(names.found)
            assert not port.service(turn * LOOK_UP_S + 2 * PROBE_S)
