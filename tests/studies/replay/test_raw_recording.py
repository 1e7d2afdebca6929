"""Promises of raw recordings of a Tracker: they are read as they were written, and refused if damaged."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rcopterx.vicon_gateway.recording import FILE_MAGIC, RawEvent, RawRecorder
from rcopterx_studies.replay.raw_recording import RecordedConnection, connections


def recorded(*events: tuple[float, RawEvent, bytes]) -> bytes:
    sink, times = io.BytesIO(), (time_s for time_s, _, _ in events)
    recorder = RawRecorder(sink.write, lambda: next(times))
    for _, event, data in events:
        recorder.record(event, data)
    return sink.getvalue()


OPENED, ENDED = (10.0, RawEvent.OPENED, b""), (11.0, RawEvent.ENDED, b"the server closed the connection")


@given(st.lists(st.binary(max_size=50), max_size=6))
def test_recording_is_read_as_it_was_written(chunks: list[bytes]) -> None:
    received = [(10.0 + 0.125 * number, RawEvent.RECEIVED, chunk) for number, chunk in enumerate(chunks)]
    (found,) = connections(io.BytesIO(recorded(OPENED, *received, ENDED)))
    assert found == RecordedConnection([(0.125 * number, chunk) for number, chunk in enumerate(chunks)], 1.0)


def test_recording_cut_by_a_crash_is_read_up_to_the_last_whole_record() -> None:
    data = recorded(OPENED, (10.5, RawEvent.RECEIVED, b"abc"), (10.6, RawEvent.RECEIVED, b"defg"), ENDED)
    lengths = []
    for end in range(len(FILE_MAGIC), len(data) + 1):
        found = connections(io.BytesIO(data[:end]))
        lengths.append(sum(1 + len(one.chunks) + (one.ended_after_s is not None) for one in found))
    assert lengths == sorted(lengths)
    assert (lengths[0], lengths[-1]) == (0, 4)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x01\x00\x2b\x1a",
        FILE_MAGIC + bytes(8) + b"\x07" + bytes(4),
        FILE_MAGIC + bytes(8) + b"\x01" + b"\xff" * 4,
    ],
)
def test_a_file_that_is_no_recording_or_has_a_record_of_absurd_length_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="recording"):
        connections(io.BytesIO(data))


def test_connections_are_told_apart_with_times_from_their_opening() -> None:
    events = (
        (10.5, RawEvent.RECEIVED, b"a"),
        (11.0, RawEvent.ENDED, b""),
        (20.0, RawEvent.OPENED, b""),
        (20.25, RawEvent.RECEIVED, b"b"),
    )
    first, second = connections(io.BytesIO(recorded(OPENED, *events)))
    assert (first.chunks, first.ended_after_s) == ([(0.5, b"a")], 1.0)
    assert (second.chunks, second.ended_after_s) == ([(0.25, b"b")], None)
    with pytest.raises(ValueError, match="does not begin with an opened connection"):
        connections(io.BytesIO(recorded(*events)))
