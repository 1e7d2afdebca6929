"""The official SDK (inside the `motioncapture` wheel) against the Tracker emulator, beside our own client."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from datastream_strategies import float32
from support.waiting import DEADLINE_S
from tracker_bench import PATIENT

from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_frame import PROFILES, TrackedBody, TrackerFrame
from rcopterx.vicon_gateway.client import DataStreamClient
from rcopterx.vicon_gateway.frame import CapturedFrame

NAMES = ("h1", "Heli Zwei ", "Käfer")
FRAMES = 60
Seen = dict[str, tuple[list[float], list[float]]]


class SdkChild:
    """The child process and the frames it has printed."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        self.frames: list[Seen] = []
        self._process = process
        self._descriptor = process.stdout.fileno()
        self._text = b""
        os.set_blocking(self._descriptor, False)

    def read(self) -> None:
        assert self._process.poll() is None, "the SDK's process has ended"
        try:
            self._text += os.read(self._descriptor, 65_536)
        except BlockingIOError:
            return
        *lines, self._text = self._text.split(b"\n")
        self.frames += [json.loads(line) for line in lines]


@contextmanager
def sdk_client(server: TrackerServer) -> Iterator[SdkChild]:
    command = [sys.executable, str(Path(__file__).parent / "sdk_child.py"), "{}:{}".format(*server.address)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        try:
            yield SdkChild(process)
        finally:
            process.kill()


def captured(number: int, generator: np.random.Generator) -> TrackerFrame:
    """Return random poses, hidden in a third of the frames, and a body whose place is the frame number."""
    bodies = [TrackedBody("clock", (float(number), 0.0, 0.0))]
    for name in NAMES:
        x, y, z = generator.uniform(-5.0, 5.0, 3).tolist()
        quaternion = generator.normal(size=4)
        qx, qy, qz, qw = (quaternion / np.linalg.norm(quaternion)).tolist()
        bodies.append(
            TrackedBody(name, (x, y, z), (qx, qy, qz, qw), occluded=bool(generator.random() < 1 / 3))
        )
    return TrackerFrame(number, tuple(bodies), (("System", 0.0055),))


@pytest.mark.integration
@pytest.mark.parametrize("profile", PROFILES)
def test_official_sdk_sees_the_same_positions_and_occlusions_as_our_client(profile: str) -> None:
    generator = np.random.default_rng(7)
    ours: dict[int, CapturedFrame] = {}
    with (
        closing(TrackerServer(port=0, profile=profile, rate_hz=100.0)) as server,
        closing(DataStreamClient(*server.address, limits=PATIENT)) as client,
        sdk_client(server) as sdk,
    ):
        deadline_s = time.monotonic() + 2 * DEADLINE_S
        number, next_s = 0, 0.0
        while sum("clock" in seen for seen in sdk.frames) < FRAMES:
            assert time.monotonic() < deadline_s, (len(sdk.frames), server.clients, client.state)
            server.poll(0.0005)
            if time.monotonic() >= next_s:
                next_s = time.monotonic() + 0.01
                server.publish(captured(number, generator))
                number += 1
            frame = client.next_frame(0.0005)
            if frame is not None:
                ours[frame.frame] = frame
            sdk.read()
        assert server.accepted == server.clients
    compared = [compare(ours[int(seen["clock"][0][0])], seen) for seen in sdk.frames if shared(ours, seen)]
    assert len(compared) > FRAMES // 2
    assert sum(compared) > 0


def shared(ours: dict[int, CapturedFrame], seen: Seen) -> bool:
    """Both have the frame; the SDK's first ones come before it has selected segments and show nothing."""
    return "clock" in seen and int(seen["clock"][0][0]) in ours


def compare(frame: CapturedFrame, seen: Seen) -> int:
    """Compare one frame of both clients; returns the number of occluded subjects."""
    visible = {subject.name: subject for subject in frame.subjects if not subject.occluded}
    assert set(seen) == set(visible)
    for name, (position, quaternion) in seen.items():
        own = visible[name]
        assert own.position_m is not None
        assert own.quaternion_xyzw is not None
        assert position == [float32(value) for value in own.position_m]
        sign = np.sign(np.dot(quaternion, own.quaternion_xyzw))
        assert np.allclose(sign * np.array(quaternion), own.quaternion_xyzw, atol=1e-7, rtol=0.0)
    return len(frame.subjects) - len(visible)
