"""Promise of MAVLink on a serial line: an autopilot at its end is armed in its mode."""

import os
import pty
import tty
from operator import call
from types import SimpleNamespace
from typing import Any

import pytest

from rcopterx.radios.mavlink import MavlinkProtocol
from rcopterx.radios.mavlink_settings import MavlinkSettings
from rcopterx.simulator.autopilot import EmulatedAutopilot
from rcopterx.simulator.plant import BodyPose
from rcopterx.transmitter_gateway.serial_port import SerialPort

LOW = (1100.0, 1500.0, 1500.0, 1500.0, 1100.0)
IDLE = (1100.0, 1500.0, 1500.0, 1500.0, 1900.0)


@pytest.fixture
def line() -> Any:
    """Both ends of a serial line: the descriptor of one, the name of the other."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_an_autopilot_on_a_serial_line_is_armed(line: tuple[int, str]) -> None:
    master, name = line
    protocol, vehicle = MavlinkProtocol(MavlinkSettings(baud=115_200)), EmulatedAutopilot(MavlinkSettings())
    body: Any = SimpleNamespace(pose=BodyPose((0.0, 0.0, 0.0)))
    vehicle.sense(body)
    port = SerialPort(name, protocol.line, call)
    for step in range(150):
        now_s = 0.02 * step
        if port.service(now_s):
            protocol.link_opened(now_s)
        if port.is_open:
            port.write_frame(protocol.encode(LOW if step < 100 else IDLE), now_s)
            protocol.frame_written(now_s)
            answers = vehicle.receive(os.read(master, 4096), now_s) + vehicle.reports(now_s)
            os.write(master, b"".join(answers))
            protocol.receive(port.read_available(now_s), now_s)
    assert vehicle.armed
    assert protocol.status(3.0).text == "ready, 16.80 V, link 100 %"
    port.close()
