"""Promises of a replay: every connection in its order and at its times, then an end."""

import io
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest
from support.tracker import running_tracker
from support.waiting import DEADLINE_S, FakeClock, PatientClock

from rcopterx.vicon_gateway.client import ClientLimits, DataStreamClient
from rcopterx.vicon_gateway.frame import CapturedFrame
from rcopterx_studies.replay.raw_recording import RecordedConnection, connections
from rcopterx_studies.replay.tracker_replay import TrackerReplay

LIMITS = ClientLimits(connect_s=60.0, silence_min_s=60.0, retry_min_s=0.01, retry_max_s=0.02)


class Reader:
    """Bytes a client has got so far."""

    def __init__(self, replay: TrackerReplay) -> None:
        self._replay = replay
        self._socket = socket.create_connection(replay.address)
        self._socket.setblocking(False)

    def read(self) -> bytes | None:
        """What has come; None when the connection has ended."""
        for _ in range(3):
            self._replay.poll(0.001)
        try:
            return self._socket.recv(1000) or None
        except BlockingIOError:
            return b""

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def reader_of() -> Iterator[Callable[[TrackerReplay], Reader]]:
    readers: list[Reader] = []

    def connected(replay: TrackerReplay) -> Reader:
        readers.append(Reader(replay))
        return readers[-1]

    yield connected
    for reader in readers:
        reader.close()


RECORDING = [
    RecordedConnection([(0.0, b"offer"), (1.0, b"first"), (3.0, b"second")], 4.0),
    RecordedConnection([(0.5, b"again")]),
]


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_bytes_come_at_their_times_and_connections_in_their_order(
    speed: float, reader_of: Callable[[TrackerReplay], Reader]
) -> None:
    clock = FakeClock()
    with closing(TrackerReplay(RECORDING, port=0, speed=speed, clock=clock)) as replay:
        assert replay.progress == (0, 2, 0.0, 0.0)
        reader = reader_of(replay)
        assert reader.read() == b"offer"
        got = []
        for _ in range(4):
            clock.advance(1.0 / speed)
            got.append(reader.read())
        assert got == [b"first", b"", b"second", None]
        assert replay.progress == (1, 2, 4.0, 4.0)
        assert not replay.finished
        reader = reader_of(replay)
        assert reader.read() == b""
        assert not replay.finished
        clock.advance(0.5 / speed)
        assert reader.read() == b"again"
        assert reader.read() is None
        assert replay.progress == (2, 2, 0.5, 0.5)
        assert replay.finished
        assert reader_of(replay).read() == b"offer"
        assert not replay.finished


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_speed_that_is_none_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match=r"speed .*allowed is more than 0"):
        TrackerReplay(RECORDING, port=0, speed=speed)


def test_nothing_recorded_is_refused() -> None:
    with pytest.raises(ValueError, match="holds no connection"):
        TrackerReplay([], port=0)


def test_frames_of_a_recording_made_of_a_moving_body_are_the_same_again() -> None:
    sink = io.BytesIO()
    with (
        running_tracker("heli1") as server,
        closing(DataStreamClient(*server.address, limits=LIMITS, record_raw=sink.write)) as client,
    ):
        original = frames_of(client, lambda frames: len(frames) >= 20)
    recording = connections(io.BytesIO(sink.getvalue()))
    # Latest wins: what is played in a stall is never seen, so the player's time stands still meanwhile.
    clock = PatientClock(0.001)
    with (
        closing(TrackerReplay(recording, port=0, speed=2.0, clock=clock)) as replay,
        closing(DataStreamClient(*replay.address, limits=LIMITS, clock=clock)) as client,
    ):
        replayed = frames_of(client, lambda frames: replay.finished, lambda: replay.poll(0.0))
    places = {frame.frame: frame.subjects for frame in replayed}
    both = [frame for frame in original if frame.frame in places]
    assert len(both) >= 3
    assert all(places[frame.frame] == frame.subjects for frame in both)


def frames_of(
    client: DataStreamClient,
    done: Callable[[list[CapturedFrame]], bool],
    step: Callable[[], None] = lambda: None,
) -> list[CapturedFrame]:
    frames: list[CapturedFrame] = []
    end_s = time.monotonic() + DEADLINE_S
    while not done(frames):
        assert time.monotonic() < end_s, client.state
        step()
        frame = client.next_frame(0.002)
        if frame is not None:
            frames.append(frame)
    return frames
