"""The official client (cflib) flies the emulated Crazyflie: an independent reading of the protocol."""

import struct
import time
from collections.abc import Iterator
from pathlib import Path
from zlib import crc32

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie as Client
from cflib.crazyflie.log import LogConfig
from support.served import Served
from support.waiting import wait_for

from rcopterx.radios.crazyflie import CrazyflieSettings
from rcopterx.radios.crtp import LONGEST_DATA, Packet
from rcopterx.simulator.crazyflie import Crazyflie


class Answering(Crazyflie):
    """The vehicle, and what only the official client requests: identity, parameters, memories, and so on."""

    def receive(self, raw: bytes, now_s: float) -> list[bytes]:
        answer = answer_of(Packet.from_bytes(raw)) if 1 <= len(raw) <= 1 + LONGEST_DATA else None
        return super().receive(raw, now_s) if answer is None else [answer.to_bytes()]


PARAMETERS = ((b"stabilizer\0estimator\0", 2), (b"stabilizer\0controller\0", 1))
BYTE = 0x08


def answer_of(packet: Packet) -> Packet | None:
    data = packet.data
    item = int.from_bytes(data[-2:], "little") % len(PARAMETERS)
    answer: bytes | None = None
    match (packet.port, packet.channel, data[:1]):
        case (15, 0, _):
            answer = data
        case (15, 1, _):
            answer = b"Bitcraze Crazyflie".ljust(LONGEST_DATA, b"\0")
        case (2, 0, b"\3"):
            answer = struct.pack("<BHI", 3, len(PARAMETERS), crc32(repr(PARAMETERS).encode()))
        case (2, 0, b"\2") if len(data) == 3:
            answer = data + bytes((BYTE,)) + PARAMETERS[item][0]
        case (2, 1, _) if len(data) == 2:
            answer = data + bytes((0, PARAMETERS[item][1]))
        case (5, 1, b"\5"):
            answer = b"\5\0\0"
        case (4, 0, b"\1"):
            answer = b"\1\0"
    return None if answer is None else Packet(packet.port, packet.channel, answer)


@pytest.fixture
def vehicle() -> Crazyflie:
    return Answering(CrazyflieSettings(), time.monotonic())


@pytest.fixture
def served(vehicle: Crazyflie) -> Iterator[Served]:
    served = Served(vehicle)
    yield served
    served.end()


@pytest.fixture
def client(served: Served, tmp_path: Path) -> Iterator[Client]:
    cflib.crtp.init_drivers()
    client = Client(rw_cache=str(tmp_path))
    client.open_link(served.path)
    wait_for(client.is_connected, "connected")
    wait_for(lambda: client.param.is_updated, "parameters")
    yield client
    client.close_link()


def test_the_official_client_reads_logs_and_parameters_flies_and_stops_it(
    vehicle: Crazyflie, client: Client
) -> None:
    assert client.param.get_value("stabilizer.estimator") == "2"
    voltages: list[float] = []
    block = LogConfig("battery", 100)
    block.add_variable("pm.vbat", "float")
    client.log.add_config(block)
    block.data_received_cb.add_callback(lambda _time, data, _block: voltages.append(data["pm.vbat"]))
    block.start()
    wait_for(lambda: voltages, "a voltage")
    assert voltages[0] == pytest.approx(4.2, abs=0.05)

    assert client.supervisor.is_armed
    client.commander.send_setpoint(0, 0, 0, 0)
    # The client inverts the pitch on air.
    client.commander.send_setpoint(3.0, 6.0, 20.0, 33_000)
    wait_for(lambda: vehicle.motors_run, "motors run")
    throttle, aileron, elevator, rudder, _ = vehicle.take_outputs()[-1][1]
    assert (throttle, aileron, elevator, rudder) == pytest.approx((1540.0, 1540.0, 1580.0, 1540.0))
    client.supervisor.send_emergency_stop()
    wait_for(lambda: not vehicle.motors_run, "motors stopped")
    wait_for(lambda: client.supervisor.is_locked, "locked")
