"""What was on the bus becomes a recording of free flight, or the reason why not."""

import math

import numpy as np
import pytest

from rcopterx.bus.messages import Applied, Pose
from rcopterx.control.identification.recording import FlightRecording, RecordingError
from rcopterx.flights.ordinary_flight import WINDOW_S, OrdinaryFlight, recording_of

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
        state=state, input=(min(0.001 * frame, 1.0), 0.0, 0.5, 0.0), pulse_width_us=(), epoch=1, frame=frame,
        sequence=frame, fresh=fresh,
    )  # fmt: skip


def recorded(poses: list[Pose], inputs: list[Applied]) -> FlightRecording:
    return recording_of(poses, inputs, "coaxial", 0.02)


POSES = [pose(frame) for frame in range(100, 100 + 2 * ROWS)]
INPUTS = [applied(frame) for frame in range(100, 100 + 2 * ROWS, 2)]


def test_every_control_period_becomes_a_row_of_its_pose_and_its_sticks() -> None:
    found = recorded(POSES, INPUTS)
    assert found.kind == "coaxial"
    assert len(found.yaw_rad) == ROWS
    assert found.position_m[:, 0] == pytest.approx(0.001 * np.arange(100, 100 + 2 * ROWS, 2))
    assert found.inputs[:, 0] == pytest.approx(found.position_m[:, 0])
    assert found.tilt is not None
    assert found.tilt[:, 0] == pytest.approx(math.sin(0.1))


def test_repeated_frames_of_the_radio_do_not_count() -> None:
    keep_alives = [applied(frame, fresh=False) for frame in range(101, 100 + 2 * ROWS, 2)]
    assert (recorded(POSES, INPUTS + keep_alives).inputs == recorded(POSES, INPUTS).inputs).all()


def test_an_occluded_pose_is_bridged() -> None:
    poses = [pose(frame, occluded=frame == 120) for frame in range(100, 180)]
    assert recorded(poses, INPUTS).position_m[10, 0] == pytest.approx(0.12)


def test_flights_that_tell_nothing_are_refused() -> None:
    poses, inputs = POSES[:20], INPUTS[:10]
    with pytest.raises(RecordingError, match="no poses, or no commands"):
        recorded(poses, [])
    with pytest.raises(RecordingError, match="poses are missing for"):
        recorded(poses[:3] + poses[-3:], inputs)
    with pytest.raises(RecordingError, match="the arbiter was hold meanwhile"):
        recorded(poses, [*inputs, applied(120, state="hold")])
    with pytest.raises(RecordingError, match="the motion capture restarted"):
        recorded([*poses, pose(1, epoch=2)], inputs)


def flown(seconds: float) -> OrdinaryFlight:
    flight = OrdinaryFlight("coaxial", 0.02)
    for frame in range(round(seconds / 0.01)):
        flight.add_pose(pose(frame))
        if frame % 2 == 0:
            flight.add_applied(applied(frame))
    return flight


def test_only_the_last_minute_is_kept() -> None:
    flight = flown(WINDOW_S + 20.0)
    assert flight.duration_s == pytest.approx(WINDOW_S, abs=0.05)
    assert flight.extent_m == pytest.approx(0.1 * WINDOW_S, abs=0.01)
    assert flight.recording().duration_s == pytest.approx(WINDOW_S, abs=0.05)


def test_a_flight_begins_anew_after_an_override_or_a_restart_or_a_gap() -> None:
    flight = flown(10.0)
    flight.add_applied(applied(1000, state="hold"))
    assert flight.duration_s == 0.0
    flight = flown(10.0)
    flight.add_pose(pose(1, epoch=2))
    assert flight.duration_s == 0.0
    flight = flown(10.0)
    flight.add_pose(pose(1100))
    flight.add_applied(applied(1100))
    with pytest.raises(RecordingError, match="missing for"):
        flight.recording()
    assert flight.duration_s == 0.0
