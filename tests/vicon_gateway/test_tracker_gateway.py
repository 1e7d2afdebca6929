"""Promises of the gateway process: poses by vehicle, a status that tells everything, recordings."""

import io
from collections.abc import Callable
from pathlib import Path

from support.tracker import running_tracker
from support.waiting import wait_for

from bus import channels
from bus.messages import TrackerStatus
from bus.session import Session
from vicon_gateway.client import DataStreamClient
from vicon_gateway.process import TrackerGateway
from vicon_gateway.recording import RawEvent, Sink, read_records
from vicon_gateway.recording_file import RecordingFile
from vicon_gateway.settings import TrackerSettings

SUBJECTS = {"heli1": "h1", "heli2": "h2"}


class Running:
    """A gateway that is stepped by the test."""

    def __init__(self, join: Callable[..., Session], address: tuple[str, int], sink: Sink | None, path: Path):
        session = join()
        self.client = DataStreamClient(*address, record_raw=sink)
        settings = TrackerSettings(session.address, *address, SUBJECTS)
        self.gateway = TrackerGateway(settings, self.client, session, False, path)
        listener = join()
        self.poses = listener.subscribe(channels.POSE, "h1", depth=4096)
        self._status = listener.subscribe(channels.TRACKER_STATUS, channels.TRACKER_UNIT)

    @property
    def status(self) -> TrackerStatus | None:
        received = self._status.latest()
        return None if received is None else received.message

    def step_until(self, condition: Callable[[TrackerStatus], bool]) -> TrackerStatus:
        def reached() -> bool:
            self.gateway.step()
            return self.status is not None and condition(self.status)

        wait_for(reached, f"not reached: {self.status}")
        assert self.status is not None
        return self.status


def test_stream_is_recorded_and_the_status_says_where(join: Callable[..., Session], tmp_path: Path) -> None:
    path = tmp_path / "session.raw"
    with running_tracker("heli1", "heli2") as server, RecordingFile.create(path) as file:
        running = Running(join, server.address, file, path)
        status = running.step_until(lambda status: status.counters["frames"] > 20)
        running.client.close()
    assert status.recording.endswith(f" bytes in {path}")
    assert int(status.recording.split()[0]) > 0
    assert status.counters["recording failures"] == 0
    with path.open("rb") as source:
        records = list(read_records(source))
    assert (records[0].event, records[-1].event) == (RawEvent.OPENED, RawEvent.ENDED)
    assert sum(len(record.data) for record in records[1:-1]) == running.client.state.received_bytes


def test_gateway_flies_on_when_the_recording_fails_and_says_so(
    join: Callable[..., Session], tmp_path: Path
) -> None:
    class FullDisk(io.BytesIO):
        def write(self, data: object) -> int:
            raise OSError(28, "No space left on device")

    with running_tracker("heli1", "heli2") as server, RecordingFile(FullDisk(), tmp_path) as file:
        running = Running(join, server.address, file, tmp_path)
        status = running.step_until(lambda status: status.counters["recording failures"] == 1)
        assert "No space left on device" in status.recording
        frame = status.frame
        running.step_until(lambda status: status.frame > frame + 20)
        running.client.close()
        assert any(received.message.frame > frame for received in running.poses.drain())
