"""Promises of raw recordings of a Tracker: they are read as they were written, and refused if damaged."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.vicon_gateway.recording import FILE_MAGIC, RawEvent, RawRecorder
from rcopterx_studies.replay.raw_recording import RawRecord, RawRecordingError, connections, read_records


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
