"""Promises of the recorder: twelve vehicles, a disk that is full, a million messages."""

import shutil
import signal
import subprocess
import time
import tracemalloc
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.bus import Child
from support.traffic import Traffic
from support.waiting import wait_for
from test_recorder import RECORDER_CODE, raw, recorded, recorder

from rcopterx.bus import channels
from rcopterx.bus.log_messages import RecorderStatus
from rcopterx.bus.session import BusAddress, Session
from rcopterx.flights.flight_writing import FREE_BYTES
from rcopterx.flights.recorder import Waiting
from rcopterx_studies.benchmarks.processes import cpu_s

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(180)]

VEHICLES = 12
CONTROL = (channels.POSE, channels.PLAN, channels.COMMAND, channels.APPLIED, channels.AGENT_STEPS)
"""What every vehicle says in every control period."""
LONGEST_LOSS_S = 0.2


@pytest.fixture
def traffic(join: Callable[..., Session]) -> Iterator[Traffic]:
    running = Traffic(join(), VEHICLES, CONTROL)
    yield running
    running.end()


def recorder_process(address: BusAddress, directory: Path) -> Child:
    """With the priority that a fleet gives it, where this is permitted."""
    arguments = (address.endpoints[0], address.fleet, str(address.namespace), str(directory))
    return Child(RECORDER_CODE.replace("flight, 0)", "flight, 0, 19)"), *arguments)


def status_of(session: Session) -> Callable[[], RecorderStatus | None]:
    inbox = session.subscribe(channels.RECORDER, "main")

    def newest() -> RecorderStatus | None:
        received = inbox.latest()
        return None if received is None else received.message

    return newest


def test_twelve_vehicles_are_recorded_whole_and_a_kill_costs_little(
    traffic: Traffic, join: Callable[..., Session], bus_address: BusAddress, tmp_path: Path
) -> None:
    status = status_of(join())
    process = recorder_process(bus_address, tmp_path)
    try:
        wait_for(lambda: status() is not None, "no recorder")
        traffic.start()
        wait_for(lambda: traffic.sent > 50, "no traffic")
        began_s, used_s, sent = time.monotonic(), cpu_s(process.pid), traffic.sent
        wait_for(lambda: traffic.sent > sent + 750, "traffic too slow", 120.0)
        share = (cpu_s(process.pid) - used_s) / (time.monotonic() - began_s)
        rate = (traffic.sent - sent) / (time.monotonic() - began_s)
    finally:
        killed_s = time.monotonic()
        process.end(signal.SIGKILL)
    messages = recorded(tmp_path)
    lost_s = min(killed_s, traffic.last_s) - max(message.time_ns for message in messages) * 1e-9
    print(f"recorder: {share:.1%} of a core at {rate:.1f} periods a second, {lost_s:.3f} s lost by the kill")
    numbers: defaultdict[str, list[int]] = defaultdict(list)
    for message in messages:
        numbers[message.topic].append(message.number)
    assert len(numbers) >= VEHICLES * len(CONTROL)
    for topic, found in numbers.items():
        assert found == list(range(found[0], found[0] + len(found))), f"{topic}: lost"
    assert lost_s <= LONGEST_LOSS_S


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system with room for two megabytes of a flight."""
    directory = tmp_path / "disk"
    directory.mkdir()
    size = f"size={FREE_BYTES + 2_000_000}"
    command = ["mount", "-t", "tmpfs", "-o", size, "tmpfs", str(directory)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True).returncode != 0:
        pytest.skip("mounting a small file system takes root")
    yield directory
    subprocess.run(["umount", "--lazy", str(directory)], check=True)


def test_a_full_file_system_ends_the_recording_and_not_the_recorder(
    traffic: Traffic, join: Callable[..., Session], bus_address: BusAddress, small_disk: Path
) -> None:
    status = status_of(join())
    process = recorder_process(bus_address, small_disk)
    try:
        wait_for(lambda: status() is not None, "no recorder")
        traffic.start()
        wait_for(lambda: (now := status()) is not None and now.state == "stopped", "it goes on", 60.0)
        stopped = status()
        assert stopped is not None
        assert "64 MiB" in stopped.reason
        assert shutil.disk_usage(small_disk).free > FREE_BYTES - 2_000_000
        sent = traffic.sent
        wait_for(lambda: traffic.sent > sent + 25, "the bus does not go on")
    finally:
        code = process.end(signal.SIGTERM)
    assert code == 0
    assert len(recorded(small_disk)) > 100


def test_memory_stays_flat_over_a_million_messages(tmp_path: Path) -> None:
    waiting = Waiting()
    log = recorder(tmp_path, waiting)

    def flown_through(count: int) -> int:
        for first in range(0, count, 500):
            for number in range(first, first + 500):
                waiting.store(raw(number, size=30))
            log.flush()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        settled = flown_through(50_000)
        assert flown_through(1_000_000) < settled + 1_000_000
    finally:
        tracemalloc.stop()
