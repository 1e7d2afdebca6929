"""Promises of the restart benchmark: its figures are those of the flight it recorded."""

from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from rcopterx.bus import channels
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import LaboratoryState, LaboratoryVehicle
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Applied, Pose
from rcopterx.bus.session import RawMessage
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.ground_station.scripting.waiting import NotReachedError
from rcopterx.transmitter_gateway.state_page import NOT_FLYING, open_page
from rcopterx_studies.benchmarks.restart import deviation_mm, flown_again_ms, summary, without_frames_ms


def record(unit: str, topic: str, message: Message, arrived_s: float) -> RawMessage:
    return RawMessage(unit, topic, encode(message), arrived_s)


def pose(frame: int, arrived_s: float) -> RawMessage:
    message = Pose(epoch=1, frame=frame, period_s=0.02, latency_s=0, received_s=arrived_s, occluded=True)
    return record("h1", channels.POSE.topic, message, arrived_s)


def applied(frame: int, arrived_s: float, state: str = "armed", fresh: bool = True) -> RawMessage:
    message = Applied(
        state=state, input=(0, 0, 0.5, 0), pulse_width_us=(1500.0,), epoch=1, frame=frame, sequence=1,
        fresh=fresh,
    )  # fmt: skip
    return record("h1", channels.APPLIED.topic, message, arrived_s)


def truth(x_m: float, arrived_s: float) -> RawMessage:
    vehicle = LaboratoryVehicle(
        position_m=(x_m, 0, 1), yaw_rad=0, velocity_m_s=(0, 0, 0), on_floor=False, outside=False
    )
    message = LaboratoryState(frame=1, sent_s=0, vehicles={"h1": vehicle})
    return record(channels.SIMULATOR_UNIT, channels.LABORATORY.topic, message, arrived_s)


def test_only_a_command_from_a_pose_after_the_kill_flies_again() -> None:
    recording = Recording(
        [
            pose(1, 9.98), applied(1, 9.985), pose(2, 10.01), applied(1, 10.02, fresh=True),
            applied(2, 10.03, fresh=False), applied(2, 10.05, state="hold"),
            pose(3, 10.03), applied(3, 10.06),
        ]
    )  # fmt: skip
    assert flown_again_ms(recording, "h1", 10.0) == pytest.approx(60.0)
    with pytest.raises(NotReachedError, match="h1 is not flown any more"):
        flown_again_ms(Recording([pose(1, 9.9), applied(1, 10.1)]), "h1", 10.0)


def test_time_without_frames_lasts_until_every_vehicle_has_got_one(tmp_path: Path) -> None:
    for name, written_s in (("h1", 10.04), ("h2", 10.09)):
        page = open_page(tmp_path / "states" / name)
        page.save(structs.replace(NOT_FLYING, written_s=written_s))
        page.close()
    assert without_frames_ms(tmp_path / "states", ["h1", "h2"], 10.0) == pytest.approx(90.0)
    assert without_frames_ms(tmp_path / "states", ["h1"], 10.0) == pytest.approx(40.0)


def test_deviations_count_from_the_middle_of_the_places_before_the_kill() -> None:
    recording = Recording([truth(x, at) for x, at in ((0.01, 9.0), (-0.01, 9.5), (0.05, 10.1), (0.02, 10.2))])
    assert deviation_mm(recording, ["h1"], 10.0) == pytest.approx(50.0)
    assert deviation_mm(recording, ["h1"], 10.0, before=True) == pytest.approx(10.0)
    assert deviation_mm(recording, [], 10.0) is None


def test_rounds_are_summed_up_by_figure() -> None:
    rows = [{"flown_again_ms": float(ms), "others": None, "events": {}} for ms in np.arange(1, 4)]
    assert summary(rows) == {"flown_again_ms": {"p50": 2.0, "p99": 2.98, "max": 3.0}, "events": [{}, {}, {}]}
