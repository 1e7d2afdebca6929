"""The official client (cflib) flies the emulated Crazyflie: an independent reading of the protocol."""

import time
from collections.abc import Iterator
from pathlib import Path

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie as Client
from cflib.crazyflie.log import LogConfig
from support.served import Served
from support.waiting import wait_for

from rcopterx.radios.crazyflie import CrazyflieSettings
from rcopterx.simulator.crazyflie import Crazyflie


@pytest.fixture
def vehicle() -> Crazyflie:
    return Crazyflie(CrazyflieSettings(), time.monotonic())


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
