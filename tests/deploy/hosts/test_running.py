"""Promises of the records of running fleets: there while a router runs, and ignored afterwards."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.records import replace
from support.waiting import wait_for

import rcopterx.deploy.hosts.running
from rcopterx.deploy.hosts.running import RunningFleet, recorded, running_fleets

RUNNING = RunningFleet(
    fleet="lab",
    digest="0123456789ab",
    namespace=None,
    host="main",
    endpoints=["tcp/127.0.0.1:7447"],
    others=[],
    vehicles=["h1", "h2"],
    snapshot="/run/lab/fleet-main.json",
)
HOLDER = """
import sys, time
from pathlib import Path
from rcopterx.deploy.hosts.running import RunningFleet, recorded
with recorded(Path(sys.argv[1]), RunningFleet("lab", "0", None, "main", [], [], [], "")):
    print("held", flush=True)
    time.sleep(600)
"""


@pytest.fixture(autouse=True)
def _run_directories(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCOPTERX_RUN", str(tmp_path))


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    path = tmp_path / "lab"
    path.mkdir()
    return path


def test_a_fleet_is_up_while_its_router_runs(directory: Path) -> None:
    assert running_fleets() == []
    with recorded(directory, RUNNING):
        assert running_fleets() == [RUNNING]
    assert running_fleets() == []
    assert list(directory.iterdir()) == []


def test_a_router_that_was_killed_is_not_up_and_its_successor_is(directory: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", HOLDER, str(directory)], stdout=subprocess.PIPE)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        assert [running.fleet for running in running_fleets()] == ["lab"]
    finally:
        process.kill()
        process.communicate()
    assert running_fleets() == []
    with recorded(directory, RUNNING):
        assert running_fleets() == [RUNNING]


def test_a_second_router_of_the_same_fleet_and_host_is_refused(
    directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rcopterx.deploy.hosts.running, "LOCK_PATIENCE_S", 0.05)
    with (
        recorded(directory, RUNNING),
        pytest.raises(OSError, match="another router of this fleet is running"),
        recorded(directory, RUNNING),
    ):
        pass


@pytest.mark.parametrize("content", [b"", b"{", b"[]", json.dumps({"fleet": "lab"}).encode()])
def test_a_record_that_is_being_written_is_no_fleet_yet(directory: Path, content: bytes) -> None:
    with recorded(directory, RUNNING):
        (directory / "up-main.json").write_bytes(content)
        assert running_fleets() == []


def test_reading_records_needs_no_validation_library(tmp_path: Path) -> None:
    unwanted = "{'msgspec', 'numpy', 'zenoh'}"
    code = f"import sys, rcopterx.deploy.hosts.running; print(sorted({unwanted} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.stdout == "[]\n"


def test_records_of_all_fleets_are_found(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    with (
        recorded(tmp_path / "a", replace(RUNNING, fleet="a")),
        recorded(tmp_path / "b", replace(RUNNING, fleet="b")),
    ):
        wait_for(lambda: len(running_fleets()) == 2, f"not both of {os.listdir(tmp_path)}")
