import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import psutil
import pytest
from datastream_strategies import float32
from support.records import replace
from support.waiting import is_running
from tracker_bench import BODIES

from rcopterx.simulator.faults import Close, Occlude, Silence
from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_frame import TrackerFrame
from rcopterx.vicon_gateway.brands import BrandClient, BrandSettings
from rcopterx.vicon_gateway.client import ClientLimits
from rcopterx.vicon_gateway.frame import CapturedFrame

MOCK = {"rigid_bodies": "h1(1,-2,0.5,0.5,0.5,0.5,-0.5);h2(0,0,1,1,0,0,0)", "frequency": "200"}
# No load alone keeps a child silent for so long.
LIMITS = ClientLimits(connect_s=20.0, silence_min_s=1.0, retry_min_s=0.01, retry_max_s=0.05)
DEADLINE_S = 40.0

pytestmark = pytest.mark.integration


def child_pid() -> int | None:
    """Process id of the child of a client of this process, None while there is none."""
    children = (each for each in psutil.Process().children() if each.status() != psutil.STATUS_ZOMBIE)
    return next((each.pid for each in children if "rcopterx.vicon_gateway.brands" in each.cmdline()), None)


def run_until(
    client: BrandClient,
    condition: Callable[[], bool],
    step: Callable[[], object] = lambda: None,
    frames: list[CapturedFrame] | None = None,
) -> list[CapturedFrame]:
    frames = [] if frames is None else frames
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s, client.state
        step()
        frame = client.next_frame(0.002)
        if frame is not None:
            frames.append(frame)
    return frames


def test_frames_of_the_library_arrive_as_frames_like_all_others() -> None:
    with closing(BrandClient(BrandSettings("mock", MOCK, 200.0, 0.004), limits=LIMITS)) as client:
        frames = run_until(client, lambda: client.state.counters.frames >= 3)
        state = client.state
    assert (state.name, state.connects, state.counters.rejected, state.last_error) == ("up", 1, 0, None)
    for frame in frames:
        assert (frame.connection, frame.period_s, frame.latency_s) == (1, 0.005, 0.004)
        h1, h2 = frame.subjects
        assert (h1.name, h1.occluded, h1.position_m) == ("h1", False, (1.0, -2.0, 0.5))
        assert h1.quaternion_xyzw == pytest.approx((0.5, 0.5, -0.5, 0.5))
        assert (h2.name, h2.quaternion_xyzw) == ("h2", (0.0, 0.0, 0.0, 1.0))
    numbers = [frame.frame for frame in frames]
    assert numbers == sorted(set(numbers))


def test_killed_child_is_replaced_and_its_frames_counted_from_zero() -> None:
    with closing(BrandClient(BrandSettings("mock", MOCK, 200.0), limits=LIMITS)) as client:
        before = run_until(client, lambda: client.state.counters.frames >= 100)[-1]
        child = child_pid()
        assert child is not None
        os.kill(child, signal.SIGKILL)
        run_until(client, lambda: client.state.last_error is not None)
        assert client.state.last_error == "mock: its process ended with code -9"
        first = run_until(client, lambda: client.state.name == "up")[0]
        assert first.connection > before.connection
        assert first.frame < before.frame


def test_frozen_child_is_killed_and_replaced() -> None:
    with closing(BrandClient(BrandSettings("mock", MOCK, 200.0), limits=LIMITS)) as client:
        run_until(client, lambda: client.state.name == "up")
        frozen = child_pid()
        assert frozen is not None
        before = client.state.connects
        os.kill(frozen, signal.SIGSTOP)
        run_until(client, lambda: client.state.connects > before and client.state.name == "up")
        assert client.state.last_error == "mock: no frame for 1 s"
        assert not is_running(frozen)


def test_vicon_back_end_sees_what_the_tracker_captures_and_survives_its_faults() -> None:
    number = 0
    next_s = 0.0
    with closing(TrackerServer(port=0, profile="tracker2", rate_hz=100.0)) as server:

        def step() -> None:
            nonlocal number, next_s
            server.poll()
            if time.monotonic() >= next_s:
                next_s = time.monotonic() + 0.01
                server.publish(TrackerFrame(number, BODIES))
                number += 1

        settings = {"hostname": "{}:{}".format(*server.address)}
        with closing(BrandClient(BrandSettings("vicon", settings, 100.0), limits=LIMITS)) as client:

            def wait_for(condition: Callable[[CapturedFrame], bool]) -> CapturedFrame:
                frames: list[CapturedFrame] = []
                run_until(client, lambda: bool(frames) and condition(frames[-1]), step, frames)
                return frames[-1]

            frame = wait_for(lambda frame: len(frame.subjects) == 2)
            for subject, body in zip(sorted(frame.subjects), BODIES, strict=True):
                assert subject.name == body.name
                assert subject.position_m == tuple(map(float32, body.position_m))
                assert subject.quaternion_xyzw == pytest.approx(body.quaternion_xyzw, abs=1e-6)
            server.apply(Occlude("h1", duration_s=1.0))
            hidden = wait_for(lambda frame: any(subject.occluded for subject in frame.subjects))
            assert [subject.name for subject in hidden.subjects if subject.occluded] == ["h1"]
            wait_for(lambda frame: not any(subject.occluded for subject in frame.subjects))
            for fault in (Close(), Silence(duration_s=2.0)):
                last = client.state.connects
                server.apply(fault)
                wait_for(lambda frame, last=last: frame.connection > last and len(frame.subjects) == 2)
                assert client.state.last_error == "vicon: no frame for 1 s"


def test_library_that_hangs_in_connect_holds_up_nobody() -> None:
    with closing(TrackerServer(port=0)) as server:
        host, port = server.address
    settings = {"hostname": f"{host}:{port}"}
    with closing(
        BrandClient(BrandSettings("vicon", settings, 100.0), limits=replace(LIMITS, connect_s=1.5))
    ) as client:
        started: list[int] = []

        def note_child() -> None:
            started.extend([child] if (child := child_pid()) is not None else [])

        run_until(client, lambda: client.state.connects >= 2, note_child)
        assert client.state.last_error == "vicon: no frame for 1.5 s"
        assert not is_running(started[0])


def test_closed_client_leaves_no_process() -> None:
    client = BrandClient(BrandSettings("mock", MOCK, 200.0), limits=LIMITS)
    run_until(client, lambda: client.state.name == "up")
    child = child_pid()
    assert child is not None
    client.close()
    assert not is_running(child)
    assert client.next_frame(60.0) is None
    assert client.state.name == "closed"


def test_child_dies_with_a_parent_that_is_killed() -> None:
    code = f"""
        import psutil
        from rcopterx.vicon_gateway.brands import BrandClient, BrandSettings
        client = BrandClient(BrandSettings("mock", {MOCK!r}, 200.0))
        while client.next_frame(1.0) is None:
            pass
        print(psutil.Process().children()[0].pid, flush=True)
        while True:
            client.next_frame(1.0)
    """
    command = [sys.executable, "-c", textwrap.dedent(code)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert is_running(child)
        parent.kill()
    deadline_s = time.monotonic() + DEADLINE_S
    while is_running(child):
        assert time.monotonic() < deadline_s


def test_library_is_not_loaded_into_the_process_that_uses_it() -> None:
    code = f"""
        import sys
        import psutil
        from rcopterx.vicon_gateway.brands import BrandClient, BrandSettings
        client = BrandClient(BrandSettings("mock", {MOCK!r}, 200.0))
        while client.next_frame(1.0) is None:
            pass
        client.close()
        print("motioncapture" in sys.modules)
    """
    command = [sys.executable, "-c", textwrap.dedent(code)]
    assert subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout == "False\n"


def test_child_does_not_inherit_the_scheduling_class_of_the_gateway() -> None:
    code = f"""
        import os
        import psutil
        from rcopterx.vicon_gateway.brands import BrandClient, BrandSettings
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        client = BrandClient(BrandSettings("mock", {MOCK!r}, 200.0))
        while client.next_frame(1.0) is None:
            pass
        print(os.sched_getscheduler(psutil.Process().children()[0].pid) == os.SCHED_OTHER)
        client.close()
    """
    command = [sys.executable, "-c", textwrap.dedent(code)]
    assert subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout == "True\n"


def fake_library(monkeypatch: pytest.MonkeyPatch, folder: Path, code: str) -> None:
    (folder / "motioncapture.py").write_text(textwrap.dedent(code))
    monkeypatch.setenv("PYTHONPATH", str(folder))


def error_of(client: BrandClient) -> str:
    with closing(client):
        run_until(client, lambda: client.state.last_error is not None)
        return str(client.state.last_error)


def test_missing_library_is_named_with_the_way_to_install_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake_library(monkeypatch, tmp_path, "raise ImportError")
    error = error_of(BrandClient(BrandSettings("mock", MOCK, 200.0), limits=LIMITS))
    assert error == "mock: the library motioncapture is not installed: pip install 'rcopterx[mocap]'"


def test_error_of_the_library_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    code = """
        def connect(brand, settings):
            print("chatter of the library")
            raise RuntimeError("no such host")
    """
    fake_library(monkeypatch, tmp_path, code)
    assert error_of(BrandClient(BrandSettings("mock", MOCK, 200.0), limits=LIMITS)) == "mock: no such host"


def test_child_that_writes_nonsense_is_replaced(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    code = """
        import os, time
        def connect(brand, settings):
            for descriptor in range(3, 10):
                try:
                    os.write(descriptor, b"\\x01\\0\\0\\0\\xc1")
                except OSError:
                    pass
            time.sleep(60.0)  # a library that hangs; the child is killed long before
    """
    fake_library(monkeypatch, tmp_path, code)
    assert "malformed message" in error_of(BrandClient(BrandSettings("mock", MOCK, 200.0), limits=LIMITS))


def test_pose_that_is_none_is_refused_counted_and_shown_as_occluded(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    code = """
        import time
        from types import SimpleNamespace as Record

        class Capture:
            rigidBodies = {
                "bad": Record(name="bad", position=[float("nan"), 0, 0], rotation=Record(x=0, y=0, z=0, w=1)),
                "odd": Record(name="odd", position=[0, 0, 0], rotation=Record(x=0, y=0, z=0, w=0)),
                "good": Record(name="good", position=[0, 0, 0], rotation=Record(x=0, y=0, z=0, w=-1)),
            }
            def waitForNextFrame(self):
                time.sleep(0.01)  # a capture of 100 Hz

        def connect(brand, settings):
            return Capture()
    """
    fake_library(monkeypatch, tmp_path, code)
    with closing(BrandClient(BrandSettings("mock", MOCK, 200.0), limits=LIMITS)) as client:
        frame = run_until(client, lambda: client.state.counters.frames >= 1)[-1]
        assert [subject.occluded for subject in frame.subjects] == [True, True, False]
        assert frame.subjects[2].quaternion_xyzw == (0.0, 0.0, 0.0, 1.0)
        assert client.state.counters.rejected == 2


@pytest.mark.parametrize(
    ("brand", "settings", "rate_hz", "latency_s", "allowed"),
    [
        ("nokov", {}, 100.0, 0.0, "optitrack, qualisys"),
        ("qualisys", {"host": "x"}, 100.0, 0.0, "hostname, port"),
        ("vrpn", {"hostname": "x"}, 0.0, 0.0, "more than 0"),
        ("vrpn", {"hostname": "x"}, 100.0, 2.0, "0 to 1"),
    ],
)
def test_wrong_settings_are_refused_with_what_is_allowed(
    brand: str, settings: dict[str, str], rate_hz: float, latency_s: float, allowed: str
) -> None:
    with pytest.raises(ValueError, match=f"allowed .*{allowed}"):
        BrandSettings(brand, settings, rate_hz, latency_s)
