import io
import time
from contextlib import closing
from pathlib import Path

from support.waiting import DEADLINE_S, PatientClock
from tracker_bench import PATIENT, READING_S, Bench

from rcopterx.simulator.faults import Close
from rcopterx.vicon_gateway.client import DataStreamClient
from rcopterx_studies.replay.raw_recording import connections
from rcopterx_studies.replay.tracker_replay import TrackerReplay


def test_full_disk_ends_the_recording_and_nothing_else() -> None:
    class FullDisk(io.BytesIO):
        def write(self, data: object) -> int:
            raise OSError(28, "No space left on device")

    with Bench(PATIENT, record_raw=FullDisk().write) as bench:
        bench.run_frames(3)
        assert "raw recording stopped: [Errno 28] No space left on device" in bench.client.state.doing


def test_session_recorded_from_one_tracker_is_replayed_by_another(tmp_path: Path) -> None:
    path = tmp_path / "session.raw"
    with path.open("wb") as sink, Bench(record_raw=sink.write) as bench:
        bench.run_frames(10)
        bench.server.apply(Close())
        bench.run_until_up(connects=2)
        bench.run_frames(5)
        original = bench.frames
    with path.open("rb") as source:
        sessions = connections(source)
    assert len(sessions) == 2
    replayed = []
    clock = PatientClock(READING_S)
    with (
        closing(TrackerReplay(sessions, port=0, clock=clock)) as server,
        closing(DataStreamClient(*server.address, limits=PATIENT, clock=clock)) as client,
    ):
        deadline_s = time.monotonic() + DEADLINE_S
        while client.state.connects < 3 and time.monotonic() < deadline_s:
            server.poll()
            frame = client.next_frame(0.0005)
            if frame is not None:
                replayed.append(frame)
    found = {(frame.connection, frame.frame): frame.subjects for frame in replayed if frame.connection < 3}
    # Latest wins on both sides, so a busy machine may skip different frames; what both saw is the same.
    both = [frame for frame in original if (frame.connection, frame.frame) in found]
    assert {frame.connection for frame in both} == {1, 2}
    for frame in both:
        assert found[frame.connection, frame.frame] == frame.subjects
