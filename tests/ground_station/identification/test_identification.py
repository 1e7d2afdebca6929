"""What was on the bus becomes a recording, or the reason why not."""

import math
import threading

import numpy as np
import pytest
from msgspec.structs import replace
from support.scripted import ScriptedVehicle

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.messages import Applied, Pose
from rcopterx.bus.requests import Excite
from rcopterx.bus.session import Incoming, RawMessage
from rcopterx.ground_station.identification.identification import (
    SWING_M,
    SWING_RAD,
    Wanted,
    excited_flights,
    recording_of,
    swing_of,
)
from rcopterx.ground_station.identification.spacing import IdentificationError
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.waiting import StoppedError, stopped_by

ROWS = 40


def pose(frame: int, epoch: int = 1, occluded: bool = False) -> Pose:
    half_rad = 0.05
    return Pose(
        epoch=epoch, frame=frame, period_s=0.01, latency_s=0.0, received_s=0.0, occluded=occluded,
        position_m=None if occluded else (0.001 * frame, 0.0, 1.0),
        quaternion_xyzw=None if occluded else (0.0, math.sin(half_rad), 0.0, math.cos(half_rad)),
    )  # fmt: skip


def applied(frame: int, state: str = "armed", fresh: bool = True) -> Applied:
    return Applied(
        state=state, input=(0.001 * frame, 0.0, 0.5, 0.0), pulse_width_us=(), epoch=1, frame=frame,
        sequence=frame, fresh=fresh,
    )  # fmt: skip


def flight(poses: list[Pose], inputs: list[Applied]) -> Recording:
    pairs = [(channels.POSE.topic, one) for one in poses] + [(channels.APPLIED.topic, one) for one in inputs]
    return Recording([RawMessage("h1", topic, encode(message), 0.0) for topic, message in pairs])


def whole(**options: bool) -> Recording:
    poses = [pose(frame) for frame in range(100, 100 + 2 * ROWS)]
    inputs = [applied(frame) for frame in range(100, 100 + 2 * ROWS, 2)]
    keep_alives = [applied(frame, fresh=False) for frame in range(101, 100 + 2 * ROWS, 2)]
    return flight(poses, inputs + keep_alives if options.get("keep_alives") else inputs)


def test_every_control_period_becomes_a_row_of_its_pose_and_its_sticks() -> None:
    found = recording_of(whole(), "h1", "coaxial", 0.02)
    assert found.kind == "coaxial"
    assert len(found.yaw_rad) == ROWS
    assert found.position_m[:, 0] == pytest.approx(0.001 * np.arange(100, 100 + 2 * ROWS, 2))
    assert found.inputs[:, 0] == pytest.approx(found.position_m[:, 0])
    assert found.tilt is not None
    assert found.tilt[:, 0] == pytest.approx(math.sin(0.1))


def test_repeated_frames_of_the_radio_do_not_count() -> None:
    found = recording_of(whole(keep_alives=True), "h1", "coaxial", 0.02)
    assert (found.inputs == recording_of(whole(), "h1", "coaxial", 0.02).inputs).all()


def test_an_occluded_pose_is_bridged() -> None:
    poses = [pose(frame, occluded=frame == 120) for frame in range(100, 180)]
    found = recording_of(flight(poses, [applied(f) for f in range(100, 180, 2)]), "h1", "coaxial", 0.02)
    assert found.position_m[10, 0] == pytest.approx(0.12)


def test_flights_that_tell_nothing_are_refused() -> None:
    poses, inputs = [pose(frame) for frame in range(100, 120)], [applied(f) for f in range(100, 120, 2)]
    with pytest.raises(IdentificationError, match="no poses, or no commands"):
        recording_of(flight(poses, []), "h1", "coaxial", 0.02)
    with pytest.raises(IdentificationError, match="poses are missing for"):
        recording_of(flight(poses[:3] + poses[-3:], inputs), "h1", "coaxial", 0.02)
    with pytest.raises(IdentificationError, match="the arbiter was hold meanwhile"):
        recording_of(flight(poses, [*inputs, applied(120, state="hold")]), "h1", "coaxial", 0.02)
    with pytest.raises(IdentificationError, match="the motion capture restarted"):
        recording_of(flight([*poses, pose(1, epoch=2)], inputs), "h1", "coaxial", 0.02)


def swing(size_m: float, size_rad: float, mean_rad: float = 0.0) -> Recording:
    """A swing at 0.8 Hz of some size, root mean square, over 3 s."""
    poses = []
    for frame in range(300):
        sine = math.sqrt(2.0) * math.sin(math.tau * 0.8 * 0.01 * frame)
        half_rad = 0.5 * (mean_rad + size_rad * sine)
        turned = (0.0, 0.0, math.sin(half_rad), math.cos(half_rad))
        poses.append(replace(pose(frame), position_m=(0.0, size_m * sine, 1.0), quaternion_xyzw=turned))
    return flight(poses, [])


def test_a_vehicle_in_a_limit_cycle_is_not_excited() -> None:
    assert swing_of(flight([], []), "h1") is None
    assert swing_of(swing(0.025, math.radians(2.3), math.pi), "h1") is None
    for swung in (swing(1.1 * SWING_M, 0.0), swing(0.0, 1.1 * SWING_RAD, math.pi)):
        assert "it does not rest" in (swing_of(swung, "h1") or "")
    assert "15 degrees rms" in (swing_of(swing(0.04, math.radians(15.0)), "h1") or "")


def test_ctrl_c_stops_every_vehicle_although_one_is_silent(
    fleet: Fleet, vehicles: dict[str, ScriptedVehicle], monkeypatch: pytest.MonkeyPatch
) -> None:
    answer, ctrl_c = vehicles["h1"].answer, threading.Event()

    def begin_only(incoming: Incoming) -> None:
        if incoming.request != Excite(duration_s=0.0):
            answer(incoming)

    monkeypatch.setattr(vehicles["h1"], "answer", begin_only)
    ctrl_c.set()
    with stopped_by(ctrl_c), pytest.raises(StoppedError):
        excited_flights(fleet, ["h1", "h2"], Wanted(20.0))
    assert vehicles["h1"].verbs == ["Excite"]
    assert vehicles["h2"].requests[1:] == [Excite(duration_s=0.0)]
