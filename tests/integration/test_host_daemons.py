"""Daemons keep a fleet flying: `up` is a client that may come and go."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from integration_support import fleet_text
from support.bus import free_port

from rcopterx.fleet.reading import load_fleet
from rcopterx.ground_station.scripting.daemons import Daemons
from rcopterx.ground_station.scripting.fleet import Fleet

pytestmark = pytest.mark.campaign

HOSTS = {"main": "127.0.0.1", "second": "127.0.0.2"}
STOP_S = 30.0


@contextmanager
def running(log: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    with log.open("wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", "rcopterx", *arguments], stdout=output, stderr=output, env=os.environ
        )
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(STOP_S)


@pytest.fixture
def fleet_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A trio on two hosts of this computer; its daemons run, but nothing else."""
    with ExitStack() as stack:
        # A short path, because the routers' sockets live in it.
        run = stack.enter_context(TemporaryDirectory(prefix="rcopterx-"))
        monkeypatch.setenv("RCOPTERX_RUN", run)
        port = free_port()
        path = tmp_path / "lab.toml"
        hosts = {host: (address, port) for host, address in HOSTS.items()}
        path.write_text(fleet_text(free_port(), hosts, agent_host="second"))
        for host in HOSTS:
            stack.enter_context(
                running(tmp_path / f"{host}.log", "host", str(path), "--host", host, "--no-record")
            )
        yield path


def test_a_fleet_flies_on_when_the_program_that_started_it_is_killed(
    fleet_path: Path, tmp_path: Path
) -> None:
    file = load_fleet(fleet_path)
    with ExitStack() as stack:
        fleet = Fleet(file, "main", timeout_s=30)
        stack.callback(fleet.close)
        daemons = Daemons(fleet)
        fleet.wait_until(lambda: fleet.launchers().keys() == HOSTS.keys(), 30, "no daemons")
        assert fleet.present() == []
        up = stack.enter_context(running(tmp_path / "up.log", "up", str(fleet_path)))
        fleet.wait_until(lambda: len(fleet.present()) == 3, 30, "the daemons do not start the agents")
        fleet.wait_ready(timeout_s=30)
        fleet.take_off()
        up.kill()
        up.wait()
        fleet.wait_for_formation()
        assert all(vehicle.state.airborne for vehicle in fleet)
        assert daemons.find() == []
        assert daemons.start() == ["main runs already", "second runs already"]
        assert any("in the air; land first" in line for line in daemons.stop())
        fleet.land()
        fleet.wait_until(lambda: daemons.stop() == [], 30, "the daemons do not stop")
        fleet.wait_until(lambda: fleet.present() == [], 30, "agents are still there")
