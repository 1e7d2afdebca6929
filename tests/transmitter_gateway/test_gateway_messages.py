"""What a transmitter gateway does with messages and when it reports, in virtual time."""

import math

import pytest
from gateway_bench import NAMES, Laboratory

from rcopterx.bus.codec import decode
from rcopterx.bus.keys import FLEET_UNIT
from rcopterx.bus.messages import Kill, Pose, TransmitterStatus
from rcopterx.bus.requests import KillVehicle, Reply
from rcopterx.bus.session import Incoming
from rcopterx.transmitter_gateway.inputs import PoseInput, State
from rcopterx.transmitter_gateway.process import POSES_KEPT, STATUS_PERIOD_S, pose_input
from rcopterx.transmitter_gateway.radios import Radios
from rcopterx.transmitter_gateway.transmitter import Transmitter


def test_every_pose_between_two_turns_reaches_every_vehicle_with_its_time_of_arrival(
    laboratory: Laboratory, monkeypatch: pytest.MonkeyPatch
) -> None:
    laboratory.gateway.step()
    came: list[tuple[str, str, int, float]] = []

    def note(transmitter: Transmitter, pose: PoseInput, now_s: float, explained_m: float) -> None:
        came.append((transmitter.vehicle, pose.vehicle, pose.frame, now_s))

    monkeypatch.setattr(Transmitter, "on_pose", note)
    sent = []
    for frame in range(1, POSES_KEPT + 1):
        laboratory.frame, laboratory.bus.now_s = frame, 0.001 * frame
        laboratory.bus.arrive("pose", "h2", laboratory.pose(1.0))
        sent.append((frame, 0.001 * frame))
    laboratory.gateway.step()
    assert sorted(came) == [(name, "h2", *each) for name in NAMES for each in sent]


def test_kills_between_two_turns_are_all_obeyed(laboratory: Laboratory) -> None:
    laboratory.fly()
    for name in NAMES:
        laboratory.bus.arrive("kill", FLEET_UNIT, Kill(source="operator", reason="test", vehicles=(name,)))
    laboratory.gateway.step()
    assert laboratory.states() == {State.KILLED}


def test_commands_kills_and_bids_wake_the_loop_and_poses_do_not(laboratory: Laboratory) -> None:
    laboratory.fly()
    laboratory.bus.arrive("kill", FLEET_UNIT, Kill(source="operator", reason="test"))
    assert laboratory.bus.woken == {"command", "kill", "lease_bid"}


def test_a_request_for_a_vehicle_is_carried_out_and_answered_in_the_next_turn(laboratory: Laboratory) -> None:
    laboratory.fly()
    replies: list[bytes] = []
    request = KillVehicle(source="operator")
    laboratory.bus.requests.append(Incoming("h2", "kill", request, b"", laboratory.bus.now_s, replies.append))
    laboratory.gateway.step()
    (reply,) = replies
    assert decode(reply, Reply).accepted
    states = [laboratory.transmitter(name).arbiter.state for name in NAMES]
    assert states == [State.ARMED, State.KILLED, State.ARMED]


def test_every_vehicle_is_reported_periodically(laboratory: Laboratory) -> None:
    laboratory.run(0.1)
    assert not statuses_of(laboratory)
    laboratory.run(2.0)
    assert set(statuses_of(laboratory)) == set(NAMES)
    assert abs(len(statuses_of(laboratory)) / len(NAMES) - 2.1 / STATUS_PERIOD_S) < 1.0


def test_a_report_has_the_age_of_the_newest_pose(laboratory: Laboratory) -> None:
    def age_s() -> float | None:
        laboratory.gateway.nodes["h2"].report(laboratory.bus.now_s)
        _, status = laboratory.bus.published[-1]
        assert isinstance(status, TransmitterStatus)
        return status.pose_age_s

    assert age_s() is None
    laboratory.bus.arrive("pose", "h2", laboratory.pose(1.0))
    laboratory.gateway.step()
    laboratory.bus.now_s += 0.3
    assert age_s() == pytest.approx(0.3)


def statuses_of(laboratory: Laboratory) -> list[str]:
    return [name for name, message in laboratory.bus.published if isinstance(message, TransmitterStatus)]


def test_shutting_down_ends_in_time_although_a_vehicle_is_never_finished(
    laboratory: Laboratory, monkeypatch: pytest.MonkeyPatch
) -> None:
    laboratory.fly()
    monkeypatch.setattr(Radios, "longest_shutdown_s", 1.0)
    monkeypatch.setattr(Transmitter, "finished", property(lambda transmitter: transmitter.vehicle != "h2"))
    began_s = laboratory.bus.now_s
    laboratory.gateway.shut_down()
    assert laboratory.bus.now_s - began_s == pytest.approx(1.0, abs=0.03)
    assert not any(laboratory.transmitter(name).port.is_open for name in NAMES)


def pose(quaternion_xyzw: tuple[float, float, float, float] | None) -> Pose:
    return Pose(
        epoch=3, frame=7, period_s=0.01, latency_s=0.004, received_s=0.0, occluded=False,
        position_m=(1.0, 2.0, 3.0), quaternion_xyzw=quaternion_xyzw,
    )  # fmt: skip


@pytest.mark.parametrize("yaw_rad", [0.0, 0.7, -2.9])
@pytest.mark.parametrize("roll_rad", [0.0, 0.3])
@pytest.mark.parametrize("pitch_rad", [0.0, -0.2])
def test_the_arbiter_gets_the_heading_of_a_tilted_vehicle(
    yaw_rad: float, roll_rad: float, pitch_rad: float
) -> None:
    cz, sz = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    cy, sy = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    cx, sx = math.cos(roll_rad / 2), math.sin(roll_rad / 2)
    x, y = sx * cy * cz - cx * sy * sz, cx * sy * cz + sx * cy * sz
    z, w = cx * cy * sz - sx * sy * cz, cx * cy * cz + sx * sy * sz
    seen = pose_input("h2", pose((x, y, z, w)))
    assert seen == PoseInput("h2", 3, 7, (1.0, 2.0, 3.0), 0.01, seen.yaw_rad, 0.004, seen.tilt_rad)
    assert seen.yaw_rad == pytest.approx(yaw_rad)
    assert math.cos(seen.tilt_rad or 0.0) == pytest.approx(math.cos(pitch_rad) * math.cos(roll_rad))


def test_a_pose_without_heading_has_none_for_the_arbiter() -> None:
    assert pose_input("h2", pose(None)).yaw_rad is None
