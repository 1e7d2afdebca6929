"""Action and telemetry servers of MAVSDK understand the driver: an independent reading of MAVLink."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import mavsdk
import pytest
from mavsdk.plugins.action_server import ActionServer, AllowableFlightModes, FlightMode
from mavsdk.plugins.telemetry_server import AngularVelocityBody, Battery, EulerAngle, TelemetryServer
from support.udp import udp_paths
from support.waiting import wait_for

from rcopterx.radios.mavlink import MavlinkProtocol
from rcopterx.radios.protocol import FrameFlags
from rcopterx.transmitter_gateway.udp_port import UdpPort

LOW = (1100.0, 1500.0, 1500.0, 1500.0, 1100.0)
IDLE = (1100.0, 1500.0, 1500.0, 1500.0, 1900.0)


class Flown:
    """A driver, its port, and the commands that the vehicle of MAVSDK got."""

    def __init__(self) -> None:
        [path] = udp_paths(1)
        kind = mavsdk.ComponentType.AUTOPILOT
        self.vehicle = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
        self.vehicle.add_any_connection(path.replace("udp://", "udpin://"))
        component = self.vehicle.server_component()
        self.actions, self._telemetry = ActionServer(component), TelemetryServer(component)
        self.actions.set_armable(True, True)
        self.actions.set_disarmable(True, True)
        self.actions.set_allowable_flight_modes(AllowableFlightModes(*[True] * 7))
        self.commands: list[Any] = []
        self.actions.subscribe_arm_disarm(lambda _, got, __: self.commands.append((got.arm, got.force)))
        self.actions.subscribe_flight_mode_change(lambda _, mode, __: self.commands.append(mode))
        self.protocol = MavlinkProtocol()
        self.port = UdpPort(path, self.protocol)

    def send(self, channels: tuple[float, ...], until: Callable[[], object], *, kill: bool = False) -> None:
        """Send frames while the vehicle reports, until something holds."""

        def step() -> object:
            now_s = time.monotonic()
            self._telemetry.publish_attitude(EulerAngle(0.0, 0.0, 30.0, 0), AngularVelocityBody(0, 0, 0))
            self._telemetry.publish_sys_status(Battery(15.5, 50.0), *[True] * 5)
            if self.port.service(now_s):
                self.protocol.link_opened(now_s)
            frame = self.protocol.encode(channels, FrameFlags(kill=kill))
            self.port.write_frame(frame, now_s)
            self.protocol.frame_written(now_s)
            self.protocol.receive(self.port.read_available(now_s), now_s)
            return until()

        wait_for(step, f"{self.commands}")


@pytest.fixture
def flown() -> Iterator[Flown]:
    flown = Flown()
    yield flown
    flown.port.close()
    flown.vehicle.destroy()


def test_a_vehicle_of_mavsdk_changes_its_mode_is_armed_and_is_disarmed_by_force(flown: Flown) -> None:
    # Its heartbeat is that of no autopilot that is supported.
    flown.send(LOW, lambda: "does not have the mode" in flown.protocol.status(time.monotonic()).text)
    assert flown.protocol.voltage_v(time.monotonic()) == pytest.approx(15.5)
    assert flown.commands == []
    flown.send(IDLE, lambda: len(flown.commands) == 2)
    assert flown.commands == [FlightMode.OFFBOARD, (True, False)]
    flown.send(LOW, lambda: (False, False) in flown.commands)
    flown.send(LOW, lambda: (False, True) in flown.commands, kill=True)
