"""Promises of `rcopterx replay-tracker`."""

import re
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from click.testing import Result
from support.tracker import running_tracker
from support.waiting import DEADLINE_S, wait_for
from typer.testing import CliRunner

from rcopterx.command_line import app
from rcopterx.vicon_gateway.client import ClientLimits, DataStreamClient
from rcopterx.vicon_gateway.recording import FILE_MAGIC


def run(*arguments: str) -> Result:
    result = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"not a recording", "not a raw DataStream recording"),
        (FILE_MAGIC, "the recording holds no connection"),
        (FILE_MAGIC + bytes(8) + b"\x07" + bytes(4), "damaged recording: event 7 with 0 bytes"),
        (FILE_MAGIC + bytes(8) + b"\x01" + bytes(4), "does not begin with an opened connection"),
    ],
)
def test_damaged_recording_is_refused_with_the_reason(content: bytes, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "session.raw"
    path.write_bytes(content)
    result = run("replay-tracker", str(path), "--port", "0")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {path}: ")
    assert reason in result.stderr


def test_recording_that_is_not_there_and_wrong_speed_are_refused(tmp_path: Path) -> None:
    assert run("replay-tracker", str(tmp_path / "nowhere.raw")).exit_code == 2
    path = tmp_path / "session.raw"
    path.write_bytes(FILE_MAGIC + bytes(13))
    result = run("replay-tracker", str(path), "--port", "0", "--speed", "0")
    assert (result.exit_code, "speed 0.0: allowed is more than 0" in result.stderr) == (2, True)


# The player does not wait for a client that leaves its connection.
PATIENT = ClientLimits(connect_s=60.0, silence_min_s=60.0)


def test_recording_is_played_to_who_connects_and_the_command_ends(tmp_path: Path) -> None:
    path = tmp_path / "session.raw"
    with (
        path.open("wb") as sink,
        running_tracker("heli1") as server,
        closing(DataStreamClient(*server.address, limits=PATIENT, record_raw=sink.write)) as client,
    ):
        wait_for(
            lambda: client.next_frame(0.01) is not None and client.state.counters.frames > 20, "no frames"
        )
    command = [sys.executable, "-m", "rcopterx", "replay-tracker", str(path), "--port", "0", "--speed", "2"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        found = re.search(r"1 connection; connect to 127\.0\.0\.1:(\d+)$", process.stderr.readline().strip())
        assert found is not None
        with closing(DataStreamClient("127.0.0.1", int(found[1]), limits=PATIENT)) as client:
            wait_for(lambda: client.next_frame(0.01) is None and _heard(client) > 15, "not played")
            assert process.wait(DEADLINE_S) == 0
        assert "connection 1 of 1" in process.stderr.read()
    finally:
        process.kill()
        process.wait()


def _heard(client: DataStreamClient) -> int:
    """Frames that arrived; on a busy machine several are read at once and only the newest is given."""
    return client.state.counters.frames + client.state.counters.skipped
