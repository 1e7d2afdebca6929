"""Promise of the Trackers of simulated autopilots: they show true poses, in the axes of the laboratory."""

import itertools
import math
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mavlink
from pymavlink.quaternion import QuaternionBase
from support.bus import free_port
from support.udp import udp_paths
from support.waiting import wait_for

from rcopterx.radios.udp import udp_address
from rcopterx.simulator.plant import BodyPose
from rcopterx.vicon_gateway.client import DataStreamClient
from rcopterx.vicon_gateway.frame import SubjectPose

EXAMPLE = Path(__file__).parents[2] / "examples" / "simulated_autopilots"
sys.path.insert(0, str(EXAMPLE))
import ardupilot  # noqa: E402
import crazyflie  # noqa: E402
import px4  # noqa: E402
import truth  # noqa: E402

sys.path.remove(str(EXAMPLE))

HOME_DEG = (47.0, 8.0)
TURNED = BodyPose((0.0, 0.0, 0.0), yaw_rad=-0.3, pitch_rad=-0.2, roll_rad=0.1)
ROTATION = [float(part) for part in QuaternionBase([0.1, 0.2, 0.3]).q]
"""The same in north, east, down."""


def sim_state(link: Any, north_deg: float, east_deg: float, height_m: float) -> Any:
    place = round(1e7 * (HOME_DEG[0] + north_deg)), round(1e7 * (HOME_DEG[1] + east_deg))
    return link.sim_state_encode(*ROTATION, *[0.0] * 11, height_m, *[0.0] * 5, *place)


def hil_state(link: Any, north_deg: float, east_deg: float, height_m: float) -> Any:
    place = round(1e7 * (HOME_DEG[0] + north_deg)), round(1e7 * (HOME_DEG[1] + east_deg))
    return link.hil_state_quaternion_encode(0, ROTATION, 0, 0, 0, *place, round(1e3 * height_m), *[0] * 8)


class Simulation:
    """Sends true states to the Tracker's link until it is ended, and notes what is requested of it."""

    def __init__(self, address: tuple[str, int], state: Callable[..., Any]) -> None:
        self._link = mavlink.MAVLink(None, 1, 1)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(0.02)
        self._address, self._state = address, state
        self._ending, self.requested = threading.Event(), set[tuple[float, float]]()
        self.away = (0.0, 0.0, 100.0)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        reader = mavlink.MAVLink(None)
        while not self._ending.is_set():
            beat = self._link.heartbeat_encode(mavlink.MAV_TYPE_QUADROTOR, 12, 0, 0, 0)
            for message in (beat, self._state(self._link, *self.away)):
                self._socket.sendto(message.pack(self._link), self._address)
            try:
                packets = reader.parse_buffer(self._socket.recv(2048)) or []
            except TimeoutError:
                continue
            commands = [each for each in packets if each.get_type() == "COMMAND_LONG"]
            self.requested |= {(each.param1, each.param2) for each in commands}

    def end(self) -> None:
        self._ending.set()
        self._thread.join()
        self._socket.close()


@contextmanager
def shown(body: Any) -> Iterator[Callable[[Callable[[SubjectPose], bool]], SubjectPose]]:
    """A Tracker of a body; the value waits for a pose of the subject that fulfils a condition."""
    port, ended = free_port(), threading.Event()
    serving = threading.Thread(target=truth.show, args=([body], port, ended.is_set))
    serving.start()
    seen: list[SubjectPose] = []
    try:
        with closing(DataStreamClient("127.0.0.1", port)) as client:

            def newest(condition: Callable[[SubjectPose], bool]) -> SubjectPose:
                def found() -> bool:
                    frame = client.next_frame(0.5)
                    seen.extend(() if frame is None else frame.subjects)
                    return bool(seen) and not seen[-1].occluded and condition(seen[-1])

                wait_for(found, "no such pose")
                return seen[-1]

            yield newest
    finally:
        ended.set()
        serving.join()


@pytest.mark.parametrize(
    ("vehicle", "state", "interval"),
    # With states of PX4 that are 20 ms old its tilt swings on after each step of its coarse positions.
    [(ardupilot.vehicle, sim_state, (108, 20_000)), (px4.vehicle, hil_state, (115, 5_000))],
    ids=["ardupilot", "px4"],
)
def test_a_client_of_the_tracker_sees_the_true_state(
    vehicle: Callable[[str], Any], state: Callable[..., Any], interval: tuple[float, float]
) -> None:
    [path] = udp_paths(1)
    simulation = Simulation(udp_address(path), state)
    try:
        with shown(vehicle(path.replace("udp://", "quad1=udpin:"))) as newest:
            first = newest(lambda _: True)
            assert first.position_m == pytest.approx((0.0, 0.0, 0.0), abs=0.002), "noise of 0.2 mm"
            wait_for(lambda: simulation.requested == {interval}, "no request")
            simulation.away = (1.0 / 111_319.5, 2.0 / 75_919.6, 103.0)
            pose = newest(lambda pose: pose.position_m is not None and pose.position_m[2] > 2.0)
    finally:
        simulation.end()
    assert pose.name == "quad1"
    assert pose.position_m == pytest.approx((1.0, -2.0, 3.0), abs=0.012), "steps of 1e-7 degrees"
    assert pose.quaternion_xyzw == pytest.approx(TURNED.quaternion_xyzw, abs=1e-4)


def test_two_simulations_are_shown_from_the_place_where_the_first_one_was_seen() -> None:
    origin, places_m = truth.Origin(), []
    for path, north_deg in zip(udp_paths(2), (0.0, 1.0 / 111_319.5), strict=True):
        simulation = Simulation(udp_address(path), sim_state)
        simulation.away = (north_deg, 0.0, 100.0)
        try:
            with shown(ardupilot.vehicle(path.replace("udp://", "quad1=udpin:"), origin)) as newest:
                places_m.append(newest(lambda _: True).position_m)
        finally:
            simulation.end()
    assert places_m[0] == pytest.approx((0.0, 0.0, 0.0), abs=0.002)
    assert places_m[1] == pytest.approx((1.0, 0.0, 0.0), abs=0.012), "steps of 1e-7 degrees"


def test_a_coarse_step_is_corrected_as_slowly_at_any_rate() -> None:
    shown_m = []
    for rate_hz in (50.0, 200.0):
        path = truth.SmoothPath(rate_hz)
        for message in range(round(rate_hz)):
            path.use((0.01 * (message > 0), 0.0, 0.0), (0.0, 0.0, 0.0), message / rate_hz)
            if message == round(0.2 * rate_hz):
                shown_m.append(float(path.at(message / rate_hz)[0]))
    assert shown_m == pytest.approx([0.0065, 0.0065], abs=0.0003)


@pytest.mark.parametrize("together", [1, 3])
def test_a_coarse_height_that_arrives_late_is_shown_smooth_and_true(together: int) -> None:
    path, shown_m, speed_m_s = truth.SmoothPath(), [], 1.2
    for frame in range(200):
        for late in reversed(range(together if frame % together == 0 else 0)):
            height_m = 0.01 * math.floor(2.0 * speed_m_s * (frame - late))
            path.use((0.0, 0.0, height_m), (0.0, 0.0, speed_m_s), 0.02 * frame)
        shown_m.append(float(path.at(0.02 * frame)[2]))
    steps_m = np.diff(shown_m[100:])
    assert steps_m == pytest.approx(np.full(len(steps_m), 0.02 * speed_m_s), abs=0.001)
    late_m = 0.02 * speed_m_s * np.arange(200) - shown_m
    assert 0.0 < late_m[100:].min() <= late_m[100:].max() < 0.01 + 0.04 * speed_m_s * (together > 1)


def test_a_position_that_is_missing_for_long_is_not_seen_and_the_next_one_counts() -> None:
    path = truth.SmoothPath()
    path.use((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0)
    assert path.seen(1.09)
    assert not path.seen(1.11)
    path.use((0.0, 0.0, 0.2), (0.0, 0.0, 1.0), 1.2)
    assert path.at(1.2).tolist() == [0.0, 0.0, 0.2]


def test_a_vehicle_that_stands_does_not_repeat_its_pose() -> None:
    [path] = udp_paths(1)
    simulation = Simulation(udp_address(path), sim_state)
    seen: list[SubjectPose] = []
    try:
        with shown(ardupilot.vehicle(path.replace("udp://", "quad1=udpin:"))) as newest:
            while len(seen) < 20:
                seen.append(newest(lambda _: True))
    finally:
        simulation.end()
    places = [pose.position_m for pose in seen]
    assert all(one != another for one, another in itertools.pairwise(places))


def test_a_simulation_of_crazyflies_sends_its_poses_as_text() -> None:
    port = free_port(kind=socket.SOCK_DGRAM)
    body, sender = crazyflie.TextTruth(f"crazyflie1={port}"), socket.socket(type=socket.SOCK_DGRAM)
    for text in (b"\xff", b"1 2 3", b"nan 0 0 0 0 0 1", b"1 2 3 0.0 0.0 0.6 0.8"):
        sender.sendto(text, ("127.0.0.1", port))
    with shown(body) as newest:
        pose = newest(lambda _: True)
    sender.close()
    assert pose.position_m == pytest.approx((1.0, 2.0, 3.0))
    assert pose.quaternion_xyzw == pytest.approx((0.0, 0.0, 0.6, 0.8), abs=1e-6)
