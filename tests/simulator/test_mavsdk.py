"""A client of MAVSDK flies the emulated autopilot: an independent reading of MAVLink."""

import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import mavsdk
import pytest
from mavsdk.plugins.action import Action, ActionError
from mavsdk.plugins.offboard import Attitude, Offboard, OffboardError
from mavsdk.plugins.telemetry import FlightMode, Telemetry
from support.served import Served
from support.waiting import wait_for

from rcopterx.radios.mavlink_settings import MavlinkSettings
from rcopterx.simulator.autopilot import STREAM_BEFORE_S, EmulatedAutopilot
from rcopterx.simulator.plant import BodyPose


@pytest.fixture
def vehicle() -> EmulatedAutopilot:
    vehicle = EmulatedAutopilot(MavlinkSettings(), time.monotonic())
    body: Any = SimpleNamespace(pose=BodyPose((0.0, 0.0, 0.0)))
    vehicle.sense(body)
    return vehicle


@pytest.fixture
def client(vehicle: EmulatedAutopilot) -> Iterator[Any]:
    served = Served(vehicle)
    kind = mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION)
    client = mavsdk.Mavsdk(kind)
    client.add_any_connection(served.path.replace("udp://", "udpout://"))
    system = client.first_autopilot(10.0)
    assert system is not None
    yield system
    client.destroy()
    served.end()


def test_a_client_of_mavsdk_reads_battery_attitude_and_mode(client: Any, vehicle: EmulatedAutopilot) -> None:
    telemetry = Telemetry(client)
    wait_for(lambda: telemetry.battery().voltage_v > 0, "battery")
    assert telemetry.battery().voltage_v == pytest.approx(16.8, abs=0.05)
    wait_for(lambda: abs(telemetry.attitude_euler().yaw_deg - 57.3) < 0.1, "attitude")
    assert telemetry.flight_mode() == FlightMode.HOLD
    assert not telemetry.armed()


def test_a_client_of_mavsdk_flies_offboard_after_its_stream_and_kills(
    client: Any, vehicle: EmulatedAutopilot
) -> None:
    action, offboard, telemetry = Action(client), Offboard(client), Telemetry(client)
    with pytest.raises(OffboardError):
        offboard.start()
    offboard.set_attitude(Attitude(0.0, 0.0, 57.3, 0.0))
    wait_for(lambda: streamed_s(vehicle) > STREAM_BEFORE_S, "a stream of set points")
    offboard.start()
    action.arm()
    assert vehicle.armed
    offboard.set_attitude(Attitude(6.0, 12.0, 57.3, 0.5))
    wait_for(lambda: any(each.pulses_us[0] > 1490 for each in [*vehicle.frames]), "set points")
    _, pulses_us = vehicle.take_outputs()[-1]
    # Right side down by 6 of 30 degrees, nose up by 12, heading as it is.
    assert pulses_us[:4] == pytest.approx((1500.0, 1580.0, 1340.0, 1500.0), abs=1.0)
    wait_for(lambda: telemetry.armed() and telemetry.flight_mode() == FlightMode.OFFBOARD, "heartbeat")
    action.kill()
    assert not vehicle.armed
    with pytest.raises(ActionError):
        action.arm()


def streamed_s(vehicle: EmulatedAutopilot) -> float:
    return vehicle.frames[-1].arrival_s - vehicle.frames[0].arrival_s if vehicle.frames else 0.0
