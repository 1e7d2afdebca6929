"""What was on the bus becomes a recording, or the reason why not."""

import math
import threading

import pytest
from msgspec.structs import replace
from support.scripted import ScriptedVehicle

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.messages import Pose
from rcopterx.bus.requests import Excite
from rcopterx.bus.session import Incoming, RawMessage
from rcopterx.ground_station.identification.identification import (
    SWING_M,
    SWING_RAD,
    Wanted,
    excited_flights,
    swing_of,
)
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.ground_station.scripting.waiting import StoppedError, stopped_by


def pose(frame: int) -> Pose:
    return Pose(epoch=1, frame=frame, period_s=0.01, latency_s=0.0, received_s=0.0, occluded=False,
                position_m=(0.0, 0.0, 1.0), quaternion_xyzw=(0.0, 0.0, 0.0, 1.0))  # fmt: skip


def flight(poses: list[Pose]) -> Recording:
    return Recording([RawMessage("h1", channels.POSE.topic, encode(one), 0.0) for one in poses])


def swing(size_m: float, size_rad: float, mean_rad: float = 0.0) -> Recording:
    """A swing at 0.8 Hz of some size, root mean square, over 3 s."""
    poses = []
    for frame in range(300):
        sine = math.sqrt(2.0) * math.sin(math.tau * 0.8 * 0.01 * frame)
        half_rad = 0.5 * (mean_rad + size_rad * sine)
        turned = (0.0, 0.0, math.sin(half_rad), math.cos(half_rad))
        poses.append(replace(pose(frame), position_m=(0.0, size_m * sine, 1.0), quaternion_xyzw=turned))
    return flight(poses)


def test_a_vehicle_in_a_limit_cycle_is_not_excited() -> None:
    assert swing_of(flight([]), "h1") is None
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
