"""Promises of the commands that stand for a motion capture that is not there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import Result
from support.tracker import running_tracker
from support.waiting import wait_for
from typer.testing import CliRunner

from rcopterx.cli import app
from vicon_gateway.client import DataStreamClient
from vicon_gateway.recording import FILE_MAGIC


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


def test_recording_is_played_to_who_connects_and_the_command_ends(tmp_path: Path) -> None:
    path = tmp_path / "session.raw"
    with (
        path.open("wb") as sink,
        running_tracker("heli1") as server,
        DataStreamClient(*server.address, record_raw=sink) as client,
    ):
        wait_for(lambda: client.next_frame(0.01) is not None and client.state.frames > 20, "no frames")
    command = [sys.executable, "-m", "rcopterx", "replay-tracker", str(path), "--port", "0", "--speed", "2"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        found = re.search(r"1 connection; connect to 127\.0\.0\.1:(\d+)$", process.stderr.readline().strip())
        assert found is not None
        with DataStreamClient("127.0.0.1", int(found[1])) as client:
            wait_for(lambda: client.next_frame(0.01) is None and client.state.frames > 15, "not played")
            assert process.wait(10) == 0
        assert "connection 1 of 1" in (process.stdout.read() if process.stdout else "")
    finally:
        process.kill()
        process.wait()
