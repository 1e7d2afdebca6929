"""Promise of the Tracker of simulated autopilots: it shows their poses in its own axes."""

import socket
import sys
import threading
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common as mavlink
from support.bus import free_port
from support.udp import udp_paths
from support.waiting import wait_for

from rcopterx.radios.udp import udp_address
from rcopterx.simulator.plant import BodyPose
from rcopterx.vicon_gateway.client import DataStreamClient
from rcopterx.vicon_gateway.frame import SubjectPose

EXAMPLE = Path(__file__).parents[2] / "examples" / "simulated_autopilots"
sys.path.insert(0, str(EXAMPLE))
import autopilot_tracker  # noqa: E402

sys.path.remove(str(EXAMPLE))


class Vehicle:
    """Sends reports to the Tracker's link until it is ended, and notes what is requested of it."""

    def __init__(self, address: tuple[str, int]) -> None:
        self._link = mavlink.MAVLink(None, 1, 1)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(0.02)
        self._address = address
        self._ending = threading.Event()
        self.requested: set[float] = set()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        reader = mavlink.MAVLink(None)
        while not self._ending.is_set():
            for message in (
                self._link.heartbeat_encode(mavlink.MAV_TYPE_QUADROTOR, 12, 0, 0, 0),
                self._link.attitude_encode(0, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0),
                self._link.local_position_ned_encode(0, 1.0, 2.0, -3.0, 0.0, 0.0, 0.0),
            ):
                self._socket.sendto(message.pack(self._link), self._address)
            try:
                packets = reader.parse_buffer(self._socket.recv(2048)) or []
            except TimeoutError:
                continue
            self.requested |= {each.param1 for each in packets if each.get_type() == "COMMAND_LONG"}

    def end(self) -> None:
        self._ending.set()
        self._thread.join()
        self._socket.close()


def test_a_client_of_the_tracker_sees_the_autopilot() -> None:
    [path] = udp_paths(1)
    vehicle, tracker_port, ended = Vehicle(udp_address(path)), free_port(), threading.Event()
    autopilot = autopilot_tracker.Autopilot(path.replace("udp://", "quad1=udpin:"))
    arguments = ([autopilot], tracker_port, ended.is_set)
    serving = threading.Thread(target=autopilot_tracker.show, args=arguments)
    serving.start()
    seen: list[SubjectPose] = []
    try:
        with DataStreamClient("127.0.0.1", tracker_port) as client:

            def shown() -> bool:
                frame = client.next_frame(0.5)
                seen.extend(() if frame is None else frame.subjects)
                return bool(seen) and not seen[-1].occluded

            wait_for(shown, "no pose")
        wait_for(lambda: vehicle.requested == {30, 32}, "no request")
    finally:
        ended.set()
        vehicle.end()
        serving.join()
    assert seen[-1].name == "quad1"
    assert seen[-1].position_m == pytest.approx((1.0, -2.0, 3.0), abs=1e-4)
    expected = BodyPose((0.0, 0.0, 0.0), yaw_rad=-0.3, pitch_rad=-0.2, roll_rad=0.1).quaternion_xyzw
    assert seen[-1].quaternion_xyzw == pytest.approx(expected, abs=1e-4)
