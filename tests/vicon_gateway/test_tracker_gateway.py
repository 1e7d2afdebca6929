"""Promises of the gateway process: poses by vehicle, a complete status, recordings."""

import io
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from support.tracker import running_tracker
from support.waiting import wait_for
from tracker_bench import PATIENT

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.host_messages import TrackerStatus
from rcopterx.bus.intent import FlownBy, Intent
from rcopterx.bus.messages import Applied, SetPoint
from rcopterx.bus.session import Session
from rcopterx.vicon_gateway.client import DataStreamClient
from rcopterx.vicon_gateway.process import TrackerGateway, TrackerSettings
from rcopterx.vicon_gateway.recording import FILE_MAGIC, RecordingFile

SUBJECTS = {"heli1": "h1", "heli2": "h2"}


class Running:
    """A gateway that is stepped by the test."""

    def __init__(
        self, join: Callable[..., Session], address: tuple[str, int], file: RecordingFile | None, path: Path
    ):
        session = join()
        self.client = DataStreamClient(
            *address, limits=PATIENT, record_raw=None if file is None else file.write
        )
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
    with running_tracker("heli1", "heli2") as server, closing(RecordingFile.create(path)) as file:
        running = Running(join, server.address, file, path)
        status = running.step_until(lambda status: status.counters["frames"] > 20)
        running.client.close()
    assert status.recording.endswith(f" bytes in {path}")
    assert int(status.recording.split()[0]) > 0
    assert status.counters["recording failures"] == 0
    assert path.read_bytes().startswith(FILE_MAGIC)


def test_gateway_flies_on_when_the_recording_fails_and_says_so(
    join: Callable[..., Session], tmp_path: Path
) -> None:
    class FullDisk(io.BytesIO):
        def write(self, data: object) -> int:
            raise OSError(28, "No space left on device")

    with running_tracker("heli1", "heli2") as server, closing(RecordingFile(FullDisk(), tmp_path)) as file:
        running = Running(join, server.address, file, tmp_path)
        status = running.step_until(lambda status: status.counters["recording failures"] == 1)
        assert "No space left on device" in status.recording
        frame = status.frame
        running.step_until(lambda status: status.frame > frame + 20)
        running.client.close()
        assert any(received.message.frame > frame for received in running.poses.drain())


def applied(epoch: int) -> Applied:
    return Applied(
        state="armed", input=(0.0, 0.0, 0.5, 0.0), pulse_width_us=(1500.0,), epoch=epoch, frame=1, sequence=1,
        fresh=True,
    )  # fmt: skip


def intent(epoch: int) -> Intent:
    return Intent(
        phase="flying", epoch=epoch, frame=1, set_point=SetPoint(position_m=(0.0, 0.0, 1.0), yaw_rad=0.0),
        flown_by=FlownBy(controller="cascade", estimator="extended_kalman"),
    )  # fmt: skip


@pytest.mark.parametrize("channel", [channels.APPLIED, channels.INTENT])
def test_restarted_gateway_leaves_the_epoch_behind_by_which_vehicles_fly_or_are_held(
    channel: Channel[Any], join: Callable[..., Session], tmp_path: Path
) -> None:
    """The wall clock was set back by a century; transmitters that hold their vehicles obey no command."""
    flown = int(time.time() * 1000) + 100 * 365 * 86_400_000
    with running_tracker("heli1", "heli2") as server:
        running = Running(join, server.address, None, tmp_path)
        other = join()

        def heard() -> bool:
            other.publish(channels.APPLIED, "h2", applied(flown if channel is channels.APPLIED else 0))
            if channel is channels.INTENT:
                other.publish(channels.INTENT, "h2", intent(flown))
            running.gateway.step()
            return any(received.message.epoch == flown + 1 for received in running.poses.drain())

        wait_for(heard, "the epoch is not left behind")
        running.client.close()


def test_of_two_gateways_the_one_that_began_later_goes_on_and_the_other_stands_by(
    join: Callable[..., Session], tmp_path: Path
) -> None:
    with running_tracker("heli1", "heli2") as server:
        first, second = (Running(join, server.address, None, tmp_path) for _ in range(2))
        first.step_until(lambda status: status.frame > 0)
        epoch = first.gateway.epochs.epoch

        def standing_by() -> bool:
            second.gateway.step()
            first.gateway.step()
            return first.gateway.standbys == 1

        wait_for(standing_by, "both publish")
        newer = second.gateway.epochs.epoch
        assert newer > epoch
        first.poses.drain()
        for _ in range(20):
            second.gateway.step()
            first.gateway.step()
        assert {received.message.epoch for received in first.poses.drain()} == {newer}
        assert second.gateway.standbys == 0
        second.client.close()

        def gone_on() -> bool:
            first.gateway.step()
            return any(received.message.epoch > newer for received in first.poses.drain())

        wait_for(gone_on, "nobody publishes")
        first.client.close()
