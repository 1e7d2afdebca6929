import io
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.waiting import DEADLINE_S, PatientClock
from tracker_bench import PATIENT, READING_S, Bench

from rcopterx.simulator.faults import Close
from rcopterx.simulator.tracker_replay import TrackerReplay
from rcopterx.vicon_gateway.client import DataStreamClient
from rcopterx.vicon_gateway.recording import (
    FILE_MAGIC,
    RawEvent,
    RawRecord,
    RawRecorder,
    RawRecordingError,
    connections,
    read_records,
)


def recorded(*chunks: bytes) -> bytes:
    sink, times = io.BytesIO(), iter(range(100))
    recorder = RawRecorder(sink.write, lambda: float(next(times)))
    recorder.record(RawEvent.OPENED)
    for chunk in chunks:
        recorder.record(RawEvent.RECEIVED, chunk)
    recorder.record(RawEvent.ENDED, b"the server closed the connection")
    return sink.getvalue()


@given(st.lists(st.binary(max_size=50), max_size=6))
def test_recording_is_read_as_it_was_written(chunks: list[bytes]) -> None:
    records = list(read_records(io.BytesIO(recorded(*chunks))))
    assert records == [
        RawRecord(0.0, RawEvent.OPENED, b""),
        *(RawRecord(1.0 + number, RawEvent.RECEIVED, chunk) for number, chunk in enumerate(chunks)),
        RawRecord(1.0 + len(chunks), RawEvent.ENDED, b"the server closed the connection"),
    ]


def test_recording_cut_by_a_crash_is_read_up_to_the_last_whole_record() -> None:
    data = recorded(b"abc", b"defg")
    lengths = [
        len(list(read_records(io.BytesIO(data[:end])))) for end in range(len(FILE_MAGIC), len(data) + 1)
    ]
    assert lengths == sorted(lengths)
    assert (lengths[0], lengths[-1]) == (0, 4)


@pytest.mark.parametrize("data", [b"", b"\x01\x00\x2b\x1a", FILE_MAGIC + bytes(8) + b"\x07" + bytes(4)])
def test_file_that_is_no_recording_is_refused(data: bytes) -> None:
    with pytest.raises(RawRecordingError):
        list(read_records(io.BytesIO(data)))


def test_record_of_absurd_length_is_refused() -> None:
    data = FILE_MAGIC + bytes(8) + b"\x01" + b"\xff" * 4
    with pytest.raises(RawRecordingError):
        list(read_records(io.BytesIO(data)))


def test_connections_are_told_apart_with_times_from_their_opening() -> None:
    events = [
        RawRecord(10.0, RawEvent.OPENED, b""),
        RawRecord(10.5, RawEvent.RECEIVED, b"a"),
        RawRecord(11.0, RawEvent.ENDED, b""),
        RawRecord(20.0, RawEvent.OPENED, b""),
        RawRecord(20.25, RawEvent.RECEIVED, b"b"),
    ]
    first, second = connections(events)
    assert (first.chunks, first.ended_after_s) == ([(0.5, b"a")], 1.0)
    assert (second.chunks, second.ended_after_s) == ([(0.25, b"b")], None)
    with pytest.raises(RawRecordingError):
        connections(events[1:])


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
        sessions = connections(read_records(source))
    assert len(sessions) == 2
    replayed = []
    clock = PatientClock(READING_S)
    with (
        TrackerReplay(sessions, port=0, clock=clock) as server,
        DataStreamClient(*server.address, limits=PATIENT, clock=clock) as client,
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
