"""The launcher of a fleet is killed in flight, and every vehicle lands closed loop."""

import math
import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from integration_support import NAMES, fleet_text

from rcopterx.bus import channels
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.deploy.hosts.vehicle_states import remove_states
from rcopterx.fleet.reading import load_fleet
from rcopterx.ground_station.scripting.fleet import Fleet

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

TOUCHDOWN_M_S = 1.0
NEAR_M = 0.3


def processes_of(run: str) -> list[int]:
    """Processes with this run directory in their environment."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if f"RCOPTERX_RUN={run}".encode() in path.read_bytes().split(b"\0"):
                found.append(int(path.parent.name))
        except OSError:
            continue
    return [pid for pid in found if pid != os.getpid()]


def end_all(run: str) -> None:
    for pid in processes_of(run):
        os.kill(pid, signal.SIGKILL)


def test_every_vehicle_lands_closed_loop_when_the_launcher_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(fleet_text())
    with ExitStack() as stack:
        # A short path, because the router's socket lives in it.
        run = stack.enter_context(TemporaryDirectory(prefix="rcopterx-"))
        monkeypatch.setenv("RCOPTERX_RUN", run)
        file = load_fleet(path)
        stack.callback(remove_states, NAMES, run_directory(file.name, file.bus.namespace))
        stack.callback(end_all, run)
        log = stack.enter_context((tmp_path / "up.log").open("wb"))
        up = subprocess.Popen(
            [sys.executable, "-m", "rcopterx", "up", str(path), "--no-record"], stdout=log, stderr=log
        )
        fleet = Fleet(file, timeout_s=60)
        stack.callback(fleet.close)
        fleet.wait_ready(timeout_s=60)
        fleet.take_off(height_m=0.8, timeout_s=40)
        fleet.wait_for_formation()
        laboratory = fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT)
        fleet.wait_until(lambda: laboratory.latest() is not None, 30, "no truth")
        received = laboratory.latest()
        assert received is not None
        places = {name: received.message.vehicles[name].position_m for name in NAMES}
        up.kill()
        up.wait()

        def down() -> bool:
            newest = laboratory.latest()
            return newest is not None and all(newest.message.vehicles[name].on_floor for name in NAMES)

        fleet.wait_until(down, 30, "not down")
        newest = laboratory.latest()
        assert newest is not None
        for name in NAMES:
            vehicle = newest.message.vehicles[name]
            assert vehicle.touchdown_speed_m_s < TOUCHDOWN_M_S, name
            assert math.dist(vehicle.position_m[:2], places[name][:2]) < NEAR_M, name
        give_up_s = time.monotonic() + 30
        while processes_of(run):
            assert time.monotonic() < give_up_s, "processes outlive the landing"
            time.sleep(0.05)
