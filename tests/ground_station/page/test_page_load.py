"""Promises of the page's process: twelve vehicles cost it little."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.bus import free_port
from support.scripted import fleet_file_text
from support.traffic import Traffic, flown
from support.waiting import DEADLINE_S, wait_for

from rcopterx.bus import channels
from rcopterx.bus.messages import TransmitterStatus
from rcopterx.bus.session import BusAddress, Session
from rcopterx_studies.benchmarks.processes import cpu_s

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(180)]

VEHICLES = 12
CONTROL = (channels.POSE, channels.PLAN, channels.APPLIED)
TRANSMITTER = TransmitterStatus(state="armed", reason="armed", link="open", module="ready", ready=True)
MEASURED_PERIODS = 1000
LARGEST_SHARE = 0.2


@pytest.fixture
def traffic(join: Callable[..., Session]) -> Iterator[Traffic]:
    statuses = {
        channels.AGENT_STATUS: flown(channels.AGENT_STATUS),
        channels.TRANSMITTER_STATUS: [TRANSMITTER],
    }
    running = Traffic(join(), VEHICLES, CONTROL, statuses)
    running.start()
    yield running
    running.end()


def test_the_page_of_twelve_vehicles_takes_little_of_a_processor(
    traffic: Traffic, bus_address: BusAddress, tmp_path: Path
) -> None:
    client = pytest.importorskip("websockets.sync.client")
    path = tmp_path / "twelve.toml"
    path.write_text(fleet_file_text(bus_address, tuple(traffic.names)))
    port = free_port()
    page = subprocess.Popen(
        [sys.executable, "-u", "-m", "rcopterx", "ground", "-f", str(path), "--port", str(port)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"RCOPTERX_PARENT": str(os.getpid())},
    )
    try:
        assert page.stdout is not None
        address = next(line.split()[0] for line in page.stdout if line.startswith("http"))
        with client.connect(address.replace("http", "ws") + "feed", max_size=None) as browser:
            received = [0]

            def read() -> None:
                for message in browser:
                    received[0] += len(message)

            threading.Thread(target=read, daemon=True).start()
            wait_for(lambda: received[0] > 0, "the page says nothing")
            sent = traffic.sent
            wait_for(lambda: traffic.sent > sent + 100, "no traffic")
            began_s, used_s, sent, before = time.monotonic(), cpu_s(page.pid), traffic.sent, received[0]
            wait_for(lambda: traffic.sent > sent + MEASURED_PERIODS, "traffic too slow", 120.0)
            lasted_s = time.monotonic() - began_s
            share = (cpu_s(page.pid) - used_s) / lasted_s
    finally:
        page.terminate()
        page.wait(DEADLINE_S)
    rate = (traffic.sent - sent) / lasted_s
    told = (received[0] - before) / lasted_s
    print(f"page: {share:.1%} of a core at {rate:.1f} periods a second, {told / 1e3:.0f} kB/s to a browser")
    assert received[0] > before
    assert share <= LARGEST_SHARE
