"""Poses are the same whichever way they come: live, from a recording, or through the vendor's own library."""

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from support.bus import free_port
from support.fleets import HARDWARE_PAIR, PAIR
from support.waiting import wait_for

from rcopterx.bus import channels
from rcopterx.bus.messages import Pose
from rcopterx.bus.session import BusUnreachableError, Session
from rcopterx.deploy.roles.addresses import bus_address
from rcopterx.fleet.reading import load_fleet

pytestmark = [pytest.mark.integration, pytest.mark.timeout(300)]

Poses = dict[tuple[str, int], Pose]
START_S = 60.0
"""For processes to start and publish, on a machine that has other work to do as well."""
ENOUGH = 40
"""Poses that must have been seen both live and in a replay."""
REPLAYS = 4


@pytest.fixture(autouse=True)
def _own_run_directory(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with TemporaryDirectory(
        prefix="rcopterx-"
    ) as run:  # a short path, because the router's socket lives in it
        monkeypatch.setenv("RCOPTERX_RUN", run)
        yield


@contextmanager
def processes(*commands: list[str]) -> Iterator[list[subprocess.Popen[str]]]:
    running = [
        subprocess.Popen([sys.executable, "-m", *command], stderr=subprocess.PIPE, text=True)
        for command in commands
    ]
    try:
        yield running
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait(10)


@contextmanager
def laboratory(path: Path, *roles: str) -> Iterator[Callable[[], Poses]]:
    """Run these processes of a fleet; what is yielded returns all poses published so far."""
    with (
        processes(*(["rcopterx.deploy.roles", role, "main", str(path)] for role in roles)),
        joined(path) as session,
    ):
        inboxes = {name: session.subscribe(channels.POSE, name, depth=10_000) for name in ("h1", "h2")}
        poses: Poses = {}

        def seen() -> Poses:
            for name, inbox in inboxes.items():
                poses.update({(name, item.message.frame): item.message for item in inbox.drain()})
            return poses

        yield seen


@contextmanager
def joined(path: Path) -> Iterator[Session]:
    file = load_fleet(path)
    sessions: list[Session] = []

    def join() -> bool:
        try:
            sessions.append(Session(bus_address(file, "main"), timeout_s=1))
        except BusUnreachableError:
            return False
        return True

    wait_for(join, "no router", START_S)
    with sessions[0] as session:
        yield session


def fleet_file(directory: Path, base: str, tracker_port: int, more: str = "") -> Path:
    path = directory / f"{tracker_port}.toml"
    tracker = f'[tracker]\naddress = "127.0.0.1:{tracker_port}"\n{more}\n'
    path.write_text(f"{base}[hosts.main]\nrouter_port = {free_port()}\n{tracker}")
    return path


def test_replayed_recording_gives_the_same_poses_and_frame_numbers(tmp_path: Path) -> None:
    recording = tmp_path / "session.raw"
    live = fleet_file(tmp_path, PAIR, free_port(), f'record_raw = "{recording}"')
    with laboratory(live, "router", "simulator", "tracker") as seen:
        wait_for(lambda: len(seen()) > 200, "no poses", START_S)
    original = seen()

    # Latest wins, and a silent connection is given up: on a busy machine either of the two may miss frames,
    # so the recording is replayed until enough of them were seen.
    replayed: Poses = {}
    for _ in range(REPLAYS):
        replayed.update(replay(recording, tmp_path))
        both = original.keys() & replayed.keys()
        if len(both) > ENOUGH:
            break
    assert len(both) > ENOUGH
    for key in both:
        for field in ("position_m", "quaternion_xyzw", "occluded", "period_s", "quality"):
            assert getattr(replayed[key], field) == getattr(original[key], field), (key, field)


def replay(recording: Path, directory: Path) -> Poses:
    """All poses that a Vicon gateway publishes while this recording is replayed to it once."""
    with processes(["rcopterx", "replay-tracker", str(recording), "--port", "0"]) as (player,):
        assert player.stderr is not None
        found = re.search(r"connect to 127\.0\.0\.1:(\d+)", player.stderr.readline())
        assert found is not None
        copy = fleet_file(directory, HARDWARE_PAIR, int(found[1]))
        with laboratory(copy, "router", "tracker") as seen:
            assert player.wait(60) == 0
    return seen()


def test_gateway_that_reads_through_the_library_publishes_the_same_poses(tmp_path: Path) -> None:
    port = free_port()
    own = fleet_file(tmp_path, PAIR, port)
    (tmp_path / "library").mkdir()
    brand = 'brand = "vicon_sdk"\nrate_hz = 50\nlatency_s = 0.004'
    library = fleet_file(tmp_path / "library", HARDWARE_PAIR.replace('"lab"', '"copy"'), port, brand)
    with (
        laboratory(own, "router", "simulator", "tracker") as seen,
        laboratory(library, "router", "tracker") as seen_by_library,
    ):
        wait_for(lambda: len(seen_by_library()) > 100, "no poses", START_S)
    # The simulated laboratory hides vehicles for a moment now and then.
    places = {rounded(pose): pose for pose in seen().values() if not pose.occluded}
    poses = {key: pose for key, pose in seen_by_library().items() if not pose.occluded}
    # Latest wins in both: on a busy machine they may miss different frames.
    both = [pose for pose in poses.values() if rounded(pose) in places]
    assert len(both) > 50
    for pose in both:
        assert near(pose, places[rounded(pose)])
        # Latencies have a resolution of 2^-20 s.
        assert pose.latency_s == pytest.approx(0.004, abs=2.0**-21)
        assert pose.period_s == 0.02
    assert {name for name, _ in poses} == {"h1", "h2"}


def rounded(pose: Pose) -> tuple[float, ...]:
    """Position as in the library: in single precision, rounded to 10 um."""
    assert pose.position_m is not None
    return tuple(round(float(np.float32(value)), 5) for value in pose.position_m)


def near(one: Pose, other: Pose) -> bool:
    assert one.position_m is not None
    assert other.position_m is not None
    assert one.quaternion_xyzw is not None
    assert other.quaternion_xyzw is not None
    return bool(
        np.allclose(one.position_m, other.position_m, rtol=0, atol=1e-6)
        and np.allclose(one.quaternion_xyzw, other.quaternion_xyzw, rtol=0, atol=1e-6)
    )
