"""Promises of arbiter and autopilot about poses that reach the autopilot, and those that end."""

import socket
from collections.abc import Callable, Iterator

import pytest
from mavlink_bench import WOULD_REFUSE, Bench
from pymavlink.dialects.v20 import common as mavlink

from rcopterx.radios.mavlink import MavlinkProtocol
from rcopterx.radios.mavlink_settings import ARDUPILOT, MODES
from rcopterx.simulator.autopilot import (
    EKF_CHECK_S,
    LANDING,
    POSITION_S,
    EmulatedAutopilot,
)
from rcopterx.transmitter_gateway.inputs import Action, State
from rcopterx.vicon_gateway.external_poses import PoseLink, PoseSender
from rcopterx.vicon_gateway.frame import SubjectPose

OFFBOARD = MODES["offboard"].reported


@pytest.fixture
def posed(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Bench]:
    """A vehicle in flight whose estimator gets no poses any more, which the gateway still has."""

    def fly(mode: str) -> Bench:
        bench = Bench(mode=mode, external_pose=True)
        bench.fly()
        monkeypatch.setattr(bench.transmitter.protocol, "pose_seen", lambda *pose, standing: None)
        return bench

    return fly


def test_an_ardupilot_whose_mode_needs_a_position_lands_without_poses_and_says_why(
    posed: Callable[[str], Bench],
) -> None:
    bench = posed("guided")
    bench.run(POSITION_S[ARDUPILOT] + EKF_CHECK_S - 0.2)
    assert bench.state is State.ARMED
    bench.run(1.0)
    assert bench.vehicle.mode == LANDING[ARDUPILOT]
    assert bench.state is State.LAND
    assert bench.module == ("mode LAND (9): EKF variance: position lost; EKF Failsafe: changed to Land Mode")
    assert bench.vehicle.armed
    assert bench.motors_run
    bench.vehicle.armed = False
    bench.height_m = 0.0
    bench.run(8.0, None)
    assert bench.state is State.CUT
    assert not bench.request(Action.ARM)


@pytest.mark.parametrize("mode", ["guided_nogps", "offboard"])
def test_a_mode_that_needs_no_position_flies_on_without_poses(
    mode: str, posed: Callable[[str], Bench]
) -> None:
    bench = posed(mode)
    assert all(bench.run(12.0))
    assert (bench.state, bench.vehicle.armed) == (State.ARMED, True)
    assert bench.module.startswith("ready")


def test_a_vehicle_that_needs_a_position_is_not_ready_without_poses(posed: Callable[[str], Bench]) -> None:
    bench = posed("guided")
    bench.request(Action.KILL)
    bench.run(1.0, 0.0)
    bench.request(Action.RESET)
    bench.run(POSITION_S[ARDUPILOT] + 1.0, 0.0)
    assert not bench.request(Action.ARM)
    assert bench.module.startswith(f"{WOULD_REFUSE}PreArm: Need Position Estimate")


class FurtherLink:
    """The link of an autopilot that the Vicon gateway sends poses to, many times a second."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.address = self._socket.getsockname()
        self._sender = PoseSender({"c1": PoseLink(self.address, 1)})

    def pass_on(self, vehicle: EmulatedAutopilot, height_m: float, now_s: float) -> None:
        subject = SubjectPose("c1", False, (0.0, 0.0, height_m), (0.0, 0.0, 0.0, 1.0), None)
        self._sender.send("c1", subject, now_s)
        vehicle.receive(self._socket.recv(2048), now_s)

    def close(self) -> None:
        self._sender.close()
        self._socket.close()


@pytest.fixture
def further_link() -> Iterator[FurtherLink]:
    link = FurtherLink()
    yield link
    link.close()


class PosedBench(Bench):
    """An ArduPilot in a mode that needs a position, with a further link for poses."""

    def __init__(self, link: FurtherLink) -> None:
        self.link, self.posed = link, True
        host, port = link.address
        super().__init__(mode="guided", pose_port=f"udp://{host}:{port}")

    def live(self) -> None:
        if self.posed:
            self.link.pass_on(self.vehicle, 0.8 if self.motors_run else 0.0, self.now_s)
        super().live()


def texts_of(bench: Bench, seconds: float) -> str:
    """What the autopilot says while nothing is sent to its first link."""
    reader, found, end_s = mavlink.MAVLink(None), [], bench.now_s + seconds
    while bench.now_s < end_s:
        bench.now_s += 0.02
        bench.live()
        found += reader.parse_buffer(b"".join(bench.air.answers)) or []
        bench.air.answers.clear()
    return "; ".join(message.text for message in found if message.get_type() == "STATUSTEXT")


def test_poses_on_a_further_link_outlive_the_transmitter_gateway(further_link: FurtherLink) -> None:
    after_s = POSITION_S[ARDUPILOT] + EKF_CHECK_S + 2.0
    by_gateway = Bench(mode="guided", external_pose=True)
    by_gateway.fly()
    assert "EKF Failsafe" in texts_of(by_gateway, after_s)
    bench = PosedBench(further_link)
    bench.fly()
    assert texts_of(bench, after_s) == ""
    assert (bench.vehicle.armed, bench.vehicle.mode) == (True, LANDING[ARDUPILOT])
    bench.vehicle.armed = False
    bench.connect(MavlinkProtocol(bench.settings))
    bench.lease = bench.transmitter.bid(2, bench.now_s, take_over=False)
    bench.fly()


def test_an_autopilot_whose_further_link_is_silent_loses_its_position(further_link: FurtherLink) -> None:
    bench = PosedBench(further_link)
    bench.fly()
    bench.posed = False
    bench.run(POSITION_S[ARDUPILOT] + EKF_CHECK_S + 0.5)
    assert (bench.state, bench.vehicle.mode) == (State.LAND, LANDING[ARDUPILOT])
    bench.vehicle.armed = False
    bench.height_m = 0.0
    bench.run(8.0, None)
    assert bench.state is State.CUT
    bench.run(1.0, 0.0)
    assert bench.request(Action.ARM)
    bench.run(3.0, 0.0)
    assert "Need Position Estimate" in bench.module
